"""The wire full, and ten times as full: is every line read, understood and acted upon?"""

import time

from benchmarks.board import LINE_RATE_BYTES_S, board
from benchmarks.figures import Figure, Outcome
from benchmarks.frames import lost
from benchmarks.rig import connect, daemon

SECONDS = 6.0
TIMES = (1, 10)
TWIST = (0.1, 0.4)


def run(*, quick: bool = False) -> Outcome:
    """The rates reached, what they cost, and the lines lost (a fault)."""
    seconds = SECONDS / 3 if quick else SECONDS
    figures: list[Figure] = []
    faults: list[str] = []
    for times in TIMES:
        found = _saturate(times, seconds)
        figures += found.figures
        faults += found.faults
    return Outcome(tuple(figures), faults=tuple(faults))


def _saturate(times: int, seconds: float) -> Outcome:
    with board() as instrument, daemon(instrument.device) as running, connect(running) as caller:
        instrument.start(0.0, times * LINE_RATE_BYTES_S)
        began_s, before_s = time.monotonic(), running.cpu_s()
        caller.drive_for(seconds, *TWIST)
        instrument.pause()
        journal = instrument.collect()
        elapsed_s = time.monotonic() - began_s
        faults = lost(caller, journal.sent)
        cores = (running.cpu_s() - before_s) / elapsed_s
        read = sum(caller.call("get_stats")["frames"].values())
    return Outcome(
        (
            Figure(f"{times}x the wire: sent", journal.bytes_sent / elapsed_s / 1e3, "kB/s"),
            Figure(
                f"{times}x the wire: lines lost of {journal.sent.total()}", journal.sent.total() - read, "", 0
            ),
            Figure(f"{times}x the wire: daemon", cores, "core"),
        ),
        faults=tuple(f"{times}x the wire: {fault}" for fault in faults),
    )
