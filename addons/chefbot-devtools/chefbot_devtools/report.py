"""What became of a sweep, as a table and as JSON."""

import statistics
from collections import Counter
from typing import Any

import msgspec

from chefbot_devtools.job import Outcome

SHOWN_FAILURES = 20


def summary(outcomes: list[Outcome]) -> str:
    """How often each end occurred, the commonest first."""
    ends = Counter(outcome.end for outcome in outcomes)
    return ", ".join(f"{count} {end}" for end, count in ends.most_common())


def as_json(outcomes: list[Outcome]) -> dict[str, Any]:
    """Every run, and how often each end occurred."""
    return {"ends": dict(Counter(outcome.end for outcome in outcomes)), "runs": msgspec.to_builtins(outcomes)}


def print_table(outcomes: list[Outcome]) -> None:
    """A row for each world and end, and the first of the runs that were not done, with the seed that repeats each."""
    from rich.table import Table

    from chefbotd.cli.common.console import Printer

    console = Printer(highlight=False)
    table = Table("world", "end", "runs", "share", "simulated s (median)", "real s (median)")
    for world in dict.fromkeys(outcome.world for outcome in outcomes):
        of_world = [outcome for outcome in outcomes if outcome.world == world]
        for end, count in Counter(outcome.end for outcome in of_world).most_common():
            rows = [outcome for outcome in of_world if outcome.end == end]
            simulated = [row.simulated_s for row in rows if row.simulated_s is not None]
            median = f"{statistics.median(simulated):.1f}" if simulated else "-"
            took = f"{statistics.median([row.took_s for row in rows]):.1f}"
            table.add_row(world, end, str(count), f"{count / len(of_world):.0%}", median, took)
    console.print(table)
    missed = [outcome for outcome in outcomes if outcome.end != "done"]
    for outcome in missed[:SHOWN_FAILURES]:
        console.print(f"{outcome.world}, seed {outcome.seed}: {outcome.end}: {outcome.text}", markup=False)
    if len(missed) > SHOWN_FAILURES:
        console.print(f"and {len(missed) - SHOWN_FAILURES} more (--json has all)")
