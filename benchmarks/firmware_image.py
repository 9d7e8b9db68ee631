"""The Duemilanove's image in simavr: how soon it stops, what it carries, what it takes (firmware/README.md)."""

from benchmarks.figures import Figure, Outcome, percentile
from tests.firmware import limits

EDGES, QUICK_EDGES = 1_000_000, 100_000
HANGS = {1: "main loop hangs", 2: "main loop hangs, interrupts shut", 3: "main loop hangs, no tick"}


def stops(*, quick: bool) -> Outcome:
    """A host that falls silent, and a main loop that hangs."""
    figures = [
        Figure("duty 0 after the host's last line, worst of 100", max(limits.silences_s(100)), "s", 0.26)
    ]
    for how, name in HANGS.items():
        off_s, banner_s, _ = limits.hang(how)
        figures += [
            Figure(f"{name}: motors off", off_s, "s", 0.3),
            Figure(f"{name}: banner", banner_s, "s", 0.3),
        ]
    return Outcome(tuple(figures))


def load(*, quick: bool) -> Outcome:
    """Edges, busy processor, even cycles, prompt commands."""
    edges = QUICK_EDGES if quick else EDGES
    return Outcome(
        (
            Figure(
                f"edges lost of {edges:.0e} at 23,200 a second", limits.lost_edges(edges, "s 120 -80"), "", 0
            ),
            Figure("busy in the busiest 0.1 s", limits.busiest_share(3.0), "", 0.5),
            Figure("jitter of the 10 ms cycle", limits.jitter_us() / 1e3, "ms", 0.2),
            Figure("command to duty p99", percentile(limits.commands_s(300), 99) * 1e3, "ms", 12.0),
        )
    )


def size(*, quick: bool) -> Outcome:
    """Flash, static RAM, and the deepest stack that was seen."""
    return Outcome(
        (
            Figure("flash", limits.flash_bytes(), "B", 12 * 1024),
            Figure("static RAM", limits.static_bytes(), "B", 1_200),
            Figure("deepest stack", limits.stack_bytes(), "B", 256),
        )
    )
