"""``python -m benchmarks [NAME ...]``: measure, print one table, write JSON beside it.

Exits with 1 when something is wrong (a lost frame, odometry that disagrees), never because something is slow.
"""

import argparse
import json
import os
import platform
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import psutil
from rich.console import Console

from benchmarks import (
    agents,
    calls,
    cpu,
    decode,
    depth,
    estimation,
    fanout,
    latency,
    optiodom,
    physics,
    ratios,
    saturation,
    square,
    start,
)
from benchmarks.figures import NOISY_CORES, Figure, Outcome, table

RESULTS = Path(__file__).with_name("results") / "latest.json"
PLAIN_WIDTH = 120  # where there is no terminal whose width counts


def _decode(*, quick: bool) -> Outcome:
    figures = decode.run(rounds=5 if quick else decode.ROUNDS)
    ratio = Figure("decoding to bare split and convert", figures["ratio"], "x", figures["ratio_limit"])
    return Outcome((ratio, Figure("decoding a line", figures["decode_ns_per_line"] / 1e3, "us")))


def _imported(module: str, function: str = "run") -> Callable[..., Outcome]:
    """A benchmark that needs an extra, or compilers: imported when it is asked for."""

    def run(**options: Any) -> Outcome:
        found: Outcome = getattr(import_module(f"benchmarks.{module}"), function)(**options)
        return found

    return run


TAKES = {
    "estimation": ("folder", "out"),
    "localization": ("folder", "out"),
    "optiodom": ("folder", "out", "fit", "score"),
    "calibration": ("folder",),
    "slam": ("folder", "out"),
    "planner": ("folder",),
}
"""The benchmarks that take recordings, and those that write trajectories."""

Benchmark = Callable[..., Outcome]
BENCHMARKS: dict[str, Benchmark] = {
    "decode": _decode,
    "depth": depth.run,
    "square": square.run,
    "start": start.run,
    "latency": latency.run,
    "cpu": cpu.run,
    "fanout": fanout.run,
    "saturation": saturation.run,
    "optiodom": optiodom.run,
    "estimation": estimation.run,
    "physics": physics.run,
    "ratios": ratios.run,
    "slam": _imported("slam"),
    "worker": _imported("worker"),
    "localization": _imported("localization"),
    "planner": _imported("planner"),
    "navigation": _imported("navigation"),
    "situations": _imported("situations"),
    "passings": _imported("passings"),
    "serving": _imported("serving"),
    "virtual_hours": _imported("virtual_hours"),
    "calls": calls.run,
    "agents": agents.run,
    "calibration": _imported("calibration"),
    "motors": _imported("motors"),
    "wheel_speed": _imported("motors", "run_wheel_speed"),
    "page": _imported("page"),
    "camera": _imported("camera"),
    "recording": _imported("recording"),
    "firmware": _imported("firmware"),
}


def main() -> int:
    """Run what was asked for; returns the exit code."""
    options = _arguments()
    console = Console() if sys.stdout.isatty() else Console(width=PLAIN_WIDTH)
    outcomes: dict[str, Outcome] = {}
    for name in options.names or BENCHMARKS:
        with console.status(f"measuring {name}"):
            outcomes[name] = measured(partial(BENCHMARKS[name], quick=options.quick, **_more(name, options)))
    console.print(table(outcomes))
    _print_notes(console, outcomes)
    _write(options.json, outcomes, quick=options.quick)
    return int(any(outcome.faults for outcome in outcomes.values()))


def _more(name: str, options: argparse.Namespace) -> dict[str, Path]:
    """What the command line says that this benchmark takes."""
    given = {"folder": options.data, "out": options.out, "fit": options.fit, "score": options.score}
    return {key: given[key] for key in TAKES.get(name, ()) if given[key] is not None}


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"one of {', '.join(BENCHMARKS)}; all by default"
    )
    parser.add_argument("--quick", action="store_true", help="fewer samples, under a minute in all")
    parser.add_argument(
        "--json", type=Path, default=RESULTS, metavar="FILE", help="where the figures are written"
    )
    parser.add_argument(
        "--data",
        type=Path,
        metavar="FOLDER",
        help="the recordings for optiodom or slam, or the maps for planner",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FOLDER", help="where slam, localization and optiodom write trajectories"
    )
    parser.add_argument("--fit", type=Path, metavar="FOLDER", help="the runs that optiodom calibrates from")
    parser.add_argument("--score", type=Path, metavar="FOLDER", help="the runs on which optiodom judges it")
    options = parser.parse_args()
    if unknown := sorted(set(options.names) - set(BENCHMARKS)):
        parser.error(f"no benchmark {', '.join(unknown)}; there are {', '.join(BENCHMARKS)}")
    return options


def measured(benchmark: Callable[[], Outcome]) -> Outcome:
    """Run a benchmark, and note in its figures how much of a core other programs used meanwhile."""
    began_s, busy_s, own_s = time.monotonic(), _busy_s(), _own_s()
    outcome = benchmark()
    others_s = (_busy_s() - busy_s) - (_own_s() - own_s)
    noise = max(others_s, 0.0) / (time.monotonic() - began_s)
    return replace(outcome, figures=tuple(replace(figure, noise=noise) for figure in outcome.figures))


def _busy_s() -> float:
    """Processor seconds that the whole machine has used."""
    times = psutil.cpu_times()
    return float(times.user + times.nice + times.system + times.irq + times.softirq)


def _own_s() -> float:
    """Processor seconds that this process and its ended children have used."""
    usages = (resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def _print_notes(console: Console, outcomes: dict[str, Outcome]) -> None:
    if any(figure.noise > NOISY_CORES for outcome in outcomes.values() for figure in outcome.figures):
        console.print(f"~ other programs used more than {NOISY_CORES} of a core meanwhile")
    for name, outcome in outcomes.items():
        for remark in outcome.remarks:
            console.print(f"{name}: {remark}", highlight=False)
        for fault in outcome.faults:
            console.print(f"[red]{name}: WRONG: {fault}", highlight=False)


def _write(path: Path, outcomes: dict[str, Outcome], *, quick: bool) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    machine = {"cores": os.cpu_count(), "machine": platform.machine(), "python": platform.python_version()}
    found = {name: asdict(outcome) for name, outcome in outcomes.items()}
    path.write_text(json.dumps({"quick": quick, **machine, "benchmarks": found}, indent=2) + "\n")


if __name__ == "__main__":
    sys.exit(main())
