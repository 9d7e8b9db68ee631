"""The whole matrix of faults, on both robots: ``python -m tests.scenarios.matrix`` (``make faults``).

Prints what each fault cost, and exits with 1 when an outcome was not the one that is defined (see docs/safety.md), or
when nothing was tried. ``--clock virtual`` leaves out what needs the real program on a real pty, ``--only`` and
``--robot`` choose (``chefbot/tiva_bare``: that sketch on its board), ``--json`` writes every figure.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table

from tests.scenarios import fault_run, process_faults, starts
from tests.scenarios.fault_run import Result, broken
from tests.scenarios.faults import FAULTS
from tests.scenarios.robots import EVERY_ROBOT, ROBOTS, packaged_name

REMARKS = (
    "Times count from the moment of the fault, on the simulated robot, which was driven at 0.2 m/s.",
    "Frames are lost only on a wire that is cut, silent or damaged; clients only with a program that has ended.",
    "After kill -9, a crash, and while a cable is pulled, the motors run on: only firmware with a dead-man stops them.",
)

PAGE_COLUMNS = 132
"""Where there is no terminal that says how wide it is."""


class Part(NamedTuple):
    """A table of faults with a ``row``, a ``name`` and ``robots``, and how one of them is tried on a robot."""

    attempt: Callable[[Any, str], Result]
    faults: Sequence[Any]


VIRTUAL = (Part(fault_run.attempt, FAULTS), Part(starts.listen, starts.SILENT))
"""On the virtual clock: every run is like every other."""

REAL = (Part(process_faults.attempt, process_faults.PROCESS_FAULTS), Part(starts.start, starts.REFUSALS))
"""The real program, in real time."""

CLOCKS = {"virtual": VIRTUAL, "real": REAL, "both": (*VIRTUAL, *REAL)}


def run(
    robots: Sequence[str] = ROBOTS,
    wanted: Callable[[str], bool] = lambda name: True,
    parts: Sequence[Part] = CLOCKS["both"],
) -> Iterator[Result]:
    """Every fault that is wanted by its name, on every robot that can have it."""
    for robot in robots:
        for part in parts:
            for fault in part.faults:
                if packaged_name(robot) in fault.robots and wanted(fault.name):
                    yield _tried(part, fault, robot)


def _tried(part: Part, fault: Any, robot: str) -> Result:
    try:
        return part.attempt(fault, robot)
    except Exception as error:  # noqa: BLE001 - whatever it is, it is not the outcome that is defined
        return broken(robot, fault.name, error)


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
    if speeds_m_s:
        return f"[yellow]drives on, {max(speeds_m_s):.2f} m/s"
    return "[green]stops" if any(result.rest_s is not None for result in same) else "[green]does not start"


def totals(results: Sequence[Result]) -> dict[str, Any]:
    """The figures of all faults together; survived is what had the outcome that is defined."""
    stopped = [result for result in results if result.rest_s is not None]
    worst = max(stopped, key=lambda result: result.rest_s or 0.0, default=None)
    return {
        "faults injected": len(results),
        "survived": sum(not result.wrong for result in results),
        "worst stopping time": worst and f"{worst.rest_s:.2f} s ({worst.fault}, {worst.robot})",
        "frames lost": sum(result.frames_lost for result in results),
        "clients lost": sum(result.clients_lost for result in results),
    }


def _seconds(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{max(known):.3f} s" if known else ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run it, print it, and say whether all went as it must."""
    chosen = _parser().parse_args(arguments)
    began_s = time.monotonic()
    results = list(run(chosen.robot or ROBOTS, lambda name: chosen.only in name, CLOCKS[chosen.clock]))
    figures, console = totals(results), Console(width=None if sys.stdout.isatty() else PAGE_COLUMNS)
    console.print(table(results))
    for line in (*(f"{name}: {value}" for name, value in figures.items()), *REMARKS):
        console.print(line, highlight=False)
    console.print(f"took {time.monotonic() - began_s:.0f} s", highlight=False)
    if chosen.json:
        told = {"totals": figures, "results": [asdict(result) for result in results]}
        chosen.json.parent.mkdir(parents=True, exist_ok=True)
        chosen.json.write_text(json.dumps(told, indent=2) + "\n")
    return 0 if results and figures["survived"] == figures["faults injected"] else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.scenarios.matrix")
    parser.add_argument("--clock", choices=CLOCKS, default="both")
    parser.add_argument("--only", metavar="TEXT", default="", help="faults with this in their name")
    parser.add_argument(
        "--robot", choices=EVERY_ROBOT, action="append", help="both packaged ones unless told otherwise"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every figure into this file")
    return parser


if __name__ == "__main__":
    sys.exit(main())
