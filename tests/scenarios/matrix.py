"""The whole matrix of faults, on both robots: ``python -m tests.scenarios.matrix [--json FILE]`` (``make faults``).

Prints what each fault cost, and exits with 1 when an outcome was not the one that is defined (see docs/safety.md).
"""

import argparse
import json
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import structlog
from rich.console import Console
from rich.table import Table

from tests.scenarios import endings, trial
from tests.scenarios.endings import ENDINGS
from tests.scenarios.faults import FAULTS
from tests.scenarios.trial import Result

ROBOTS = ("chefbot", "khan")
REMARKS = (
    "Times count from the moment of the fault, on the simulated robot, which was driven at 0.2 m/s.",
    "Frames are lost only on a wire that is cut, silent or damaged; clients only with a program that has ended.",
    "After kill -9, and while a cable is pulled, the motors run on: only firmware with a dead-man can stop them.",
)


def run(
    robots: Sequence[str] = ROBOTS, wanted: Callable[[str], bool] = lambda name: True
) -> Iterator[Result]:
    """Every fault that is wanted by its name, on every robot."""
    for robot in robots:
        yield from (trial.attempt(fault, robot) for fault in FAULTS if wanted(fault.name))
        yield from (endings.attempt(ending, robot) for ending in ENDINGS if wanted(ending.name))


def table(results: Sequence[Result]) -> Table:
    """A row per fault; of both robots the worse figure."""
    shown = Table(title="What faults do")
    shown.add_column("fault", no_wrap=True)
    for heading in ("zero after", "rest after", "frames\nlost", "clients\nlost"):
        shown.add_column(heading, justify="right")
    shown.add_column("outcome")
    for name in dict.fromkeys(result.fault for result in results):
        same = [result for result in results if result.fault == name]
        shown.add_row(
            name,
            _seconds([result.zero_s for result in same]),
            _seconds([result.rest_s for result in same]),
            str(max(result.frames_lost for result in same)),
            str(max(result.clients_lost for result in same)),
            _outcome(same),
        )
    return shown


def _outcome(same: Sequence[Result]) -> str:
    if wrong := sorted({f"{result.robot}: {complaint}" for result in same for complaint in result.wrong}):
        return f"[red]{'; '.join(wrong)}"
    speeds_m_s = [result.drives_m_s for result in same if result.drives_m_s is not None]
    return f"[yellow]drives on, {max(speeds_m_s):.2f} m/s" if speeds_m_s else "[green]stops"


def totals(results: Sequence[Result]) -> dict[str, Any]:
    """The figures of all faults together."""
    stopped = [result for result in results if result.rest_s is not None]
    worst = max(stopped, key=lambda result: result.rest_s or 0.0, default=None)
    return {
        "faults injected": len(results),
        "survived, with the outcome that is defined": sum(not result.wrong for result in results),
        "worst stopping time": None
        if worst is None
        else f"{worst.rest_s:.2f} s ({worst.fault}, {worst.robot})",
        "frames lost": sum(result.frames_lost for result in results),
        "clients lost": sum(result.clients_lost for result in results),
    }


def _seconds(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{max(known):.3f} s" if known else ""


def main() -> int:
    """Run it, print it, and say whether all went as it must."""
    parser = argparse.ArgumentParser(prog="python -m tests.scenarios.matrix")
    parser.add_argument("--json", type=Path, help="write every figure into this file")
    arguments = parser.parse_args()
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.CRITICAL))
    results, console = list(run()), Console()
    console.print(table(results))
    for line in (*(f"{name}: {value}" for name, value in totals(results).items()), *REMARKS):
        console.print(line, highlight=False)
    if arguments.json:
        told = {"totals": totals(results), "results": [asdict(result) for result in results]}
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(told, indent=2) + "\n")
    return int(any(result.wrong for result in results))


if __name__ == "__main__":
    sys.exit(main())
