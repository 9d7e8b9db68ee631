"""The whole matrix of faults, on both robots and every sketch: ``python -m tests.scenarios.matrix`` (``make faults``).

Prints what each fault cost, and exits with 1 when an outcome was not the one that is defined (see docs/safety.md), or
when nothing was tried. ``--clock virtual`` leaves out what needs the real program on a real pty, ``--only`` and
``--robot`` choose (``chefbot/tiva_bare``: that sketch on its board), ``--json`` writes every figure. What is on the
virtual clock is shared by ``--jobs`` processes.
"""

import argparse
import json
import multiprocessing
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table

from tests.scenarios import by_tests, fault_run, navigation_run, process_faults, starts, waiting_run
from tests.scenarios.fault_run import Result, broken
from tests.scenarios.faults import BOARD_FAULTS, PROGRAM_FAULTS
from tests.scenarios.faults.on_the_way import WAY_FAULTS
from tests.scenarios.faults.waiting import WAITING_FAULTS
from tests.scenarios.robots import BOARDS, EVERY_ROBOT, ROBOTS, packaged_name

REMARKS = (
    "Times count from the moment of the fault, on the simulated robot, which was driven at 0.2 m/s.",
    "Frames are lost only on a wire that is cut, silent or damaged; clients only with a program that has ended.",
    "While a cable is pulled the motors run on: only firmware with a dead-man stops them.",
)

PAGE_COLUMNS = 132
"""Where there is no terminal that says how wide it is."""


class Part(NamedTuple):
    """A table of faults with a ``row``, a ``name`` and ``robots``, and how one of them is tried on a robot.

    One that is not ``on_sketches`` would say the same of each sketch, and is tried on the packaged robots.
    """

    attempt: Callable[[Any, str], Result]
    faults: Sequence[Any]
    on_sketches: bool = False


class Trial(NamedTuple):
    """One fault on one robot."""

    part: Part
    fault: Any
    robot: str


VIRTUAL = (
    Part(fault_run.attempt, BOARD_FAULTS, on_sketches=True),
    Part(fault_run.attempt, PROGRAM_FAULTS),
    Part(starts.listen, starts.SILENT),
    Part(navigation_run.attempt, WAY_FAULTS),
    Part(waiting_run.attempt, WAITING_FAULTS),
)
"""On the virtual clock: every run is like every other, whatever runs beside it."""

PROGRAMS = (Part(process_faults.attempt, process_faults.PROCESS_FAULTS), Part(starts.start, starts.REFUSALS))
INJECTED = frozenset([fault.row for part in (*VIRTUAL, *PROGRAMS) for fault in part.faults])
"""How the rows of docs/safety.md begin that a fault is injected for."""

REAL = (*PROGRAMS, Part(by_tests.attempt, by_tests.tested_rows(INJECTED)))
"""The real program, in real time; and what no simulated robot can have, by its tests."""

CLOCKS = {"virtual": VIRTUAL, "real": REAL, "both": (*VIRTUAL, *REAL)}


def trials(
    robots: Sequence[str], wanted: Callable[[str], bool] = lambda name: True, parts: Sequence[Part] = VIRTUAL
) -> list[Trial]:
    """Every fault that is wanted by its name, on every robot that can have it."""
    return [
        Trial(part, fault, robot)
        for robot in robots
        for part in parts
        for fault in part.faults
        if (part.on_sketches or robot in ROBOTS)
        and packaged_name(robot) in fault.robots
        and wanted(fault.name)
    ]


def run(planned: Sequence[Trial], jobs: int = 1) -> Iterator[Result]:
    """Try them, in their order; on the virtual clock so many at once."""
    if jobs == 1:
        yield from map(_tried, planned)
        return
    shared = [trial for trial in planned if trial.part in VIRTUAL]
    # Faults are functions, which no pipe carries: a forked process finds them where they are.
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("fork"), _share, (shared,)) as pool:
        yield from pool.map(_tried_shared, range(len(shared)))
    yield from map(_tried, (trial for trial in planned if trial.part not in VIRTUAL))


def _tried(trial: Trial) -> Result:
    try:
        return trial.part.attempt(trial.fault, trial.robot)
    except Exception as error:  # noqa: BLE001 - whatever it is, it is not the outcome that is defined
        return broken(trial.robot, trial.fault.name, error)


_SHARED: list[Trial] = []
"""In a process that takes part: what is to be tried."""


def _share(planned: list[Trial]) -> None:
    _SHARED[:] = planned


def _tried_shared(index: int) -> Result:
    return _tried(_SHARED[index])


def table(results: Sequence[Result]) -> Table:
    """A row per fault; of all robots the worst figure."""
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
    excused = [f"{result.robot}: {result.not_applicable}" for result in same if result.not_applicable]
    return "; ".join([_motion([result for result in same if not result.not_applicable]), *excused])


def _motion(same: Sequence[Result]) -> str:
    if told := sorted({result.outcome for result in same if result.outcome}):
        return f"[green]{', '.join(told)}[/]"
    speeds_m_s = [result.drives_m_s for result in same if result.drives_m_s is not None]
    stops = any(result.rest_s is not None for result in same)
    told = [f"[yellow]drives on, {max(speeds_m_s):.2f} m/s[/]"] if speeds_m_s else []
    return ", ".join([*(["[green]stops[/]"] if stops else []), *told]) or "[green]does not start[/]"


def totals(results: Sequence[Result]) -> dict[str, Any]:
    """The figures of all faults together; survived is what had the outcome that is defined."""
    results, given = [result for result in results if not result.not_applicable], len(results)
    stopped = [result for result in results if result.rest_s is not None]
    worst = max(stopped, key=lambda result: result.rest_s or 0.0, default=None)
    return {
        "faults injected": len(results),
        "survived": sum(not result.wrong for result in results),
        "not applicable": given - len(results),
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
    planned = trials(chosen.robot or BOARDS, lambda name: chosen.only in name, CLOCKS[chosen.clock])
    results = list(run(planned, chosen.jobs))
    figures, console = totals(results), Console(width=None if sys.stdout.isatty() else PAGE_COLUMNS)
    console.print(table(results))
    for line in (*(f"{name}: {value}" for name, value in figures.items()), *REMARKS):
        console.print(line, highlight=False)
    console.print(f"took {time.monotonic() - began_s:.0f} s", highlight=False)
    if chosen.json:
        told = {"totals": figures, "results": [asdict(result) for result in results]}
        chosen.json.parent.mkdir(parents=True, exist_ok=True)
        chosen.json.write_text(json.dumps(told, indent=2) + "\n")
    return 0 if figures["faults injected"] and figures["survived"] == figures["faults injected"] else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.scenarios.matrix")
    parser.add_argument("--clock", choices=CLOCKS, default="both")
    parser.add_argument("--only", metavar="TEXT", default="", help="faults with this in their name")
    parser.add_argument(
        "--robot",
        choices=EVERY_ROBOT,
        action="append",
        help="both packaged ones and each sketch unless told otherwise",
    )
    parser.add_argument("--jobs", type=int, default=1, help="so many processes for the virtual clock")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every figure into this file")
    return parser


if __name__ == "__main__":
    sys.exit(main())
