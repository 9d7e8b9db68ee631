"""What navigating costs: the worker's processor time and memory, and whether commands and control wait for it.

The real processes: a simulated ChefBot with a lidar in the flat, a daemon that drives it between two places of the
map, and its worker. It stands and drives by turns, in one daemon; a client asks ``get_state`` all the time, and a tap on
the board's wire notes when encoder frames and motor commands go by.
"""

import itertools
import random
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

import chefbotd.components.simulation.worlds
from benchmarks.figures import Figure, Outcome, percentile
from benchmarks.latency import answers_s
from benchmarks.rig import CHEFBOTD, Daemon, connect, running, sent, to_toml, until
from benchmarks.rpc import Caller
from benchmarks.tap import Tap, tap
from chefbotd.settings import packaged
from chefbotd.settings.loader import read_values
from chefbotd.transport.ports import reserve_port
from examples.order import PLACES as ALL_PLACES
from examples.order import START, TABLES

ROBOT, CYCLE_HZ = "chefbot_lidar", 50
MAP = Path(chefbotd.components.simulation.worlds.__file__).parent / "flat.yaml"
PLACES = TABLES[:2]
TURNS, SECONDS, QUICK_SECONDS, SETTLE_S = 6, 25.0, 8.0, 2.0
ASKED_EVERY_S = (0.02, 0.06)
READY_S, FOUND_S = 240.0, 90.0
WATCHDOG_S = 3.0
"""A busy machine holds up the daemon for longer than a real robot may be."""
HELD_UP_S = 60.0
"""It holds up the simulated board too; for so long that is no fault."""
MOST_CORES, MOST_MB, RATIO = 0.15, 150.0, 1.5
TURN_RAD_S = 0.4
ON_ITS_WAY = 2
"""So many frames may be on their way between tap and control when a turn begins or ends."""


@dataclass
class Phase:
    """What was measured while the robot did one thing; the lists are in seconds."""

    calls_s: list[float] = field(default_factory=list)
    answers_s: list[float] = field(default_factory=list)
    seconds: float = 0.0
    worker_s: float = 0.0
    daemon_s: float = 0.0
    worker_mb: float = 0.0
    missed: int = 0
    """Encoder frames without a control step."""


def run(*, quick: bool = False) -> Outcome:
    """Cores of worker and daemon, the worker's memory, latencies navigating over not, control steps that are missing."""
    turns, seconds = (2, QUICK_SECONDS) if quick else (TURNS, SECONDS)
    stands, by_hand, navigates = Phase(), Phase(), Phase()
    with _serving() as (robot, caller, wire):
        goals = itertools.cycle(PLACES)
        for _ in range(turns):
            _measure(stands, robot, caller, wire, seconds, lambda: None)
            _measure(by_hand, robot, caller, wire, seconds, lambda: _turn(caller))
            caller.call("stop")
            caller.call("release_control")
            time.sleep(SETTLE_S)
            _measure(navigates, robot, caller, wire, seconds, lambda: _keep_driving(caller, goals))
            until(lambda: sent(caller, "cancel_navigation"), "it does not stop")
            time.sleep(SETTLE_S)
    missed = sum(phase.missed for phase in (stands, by_hand, navigates))
    figures = (
        Figure("worker, navigating", navigates.worker_s / navigates.seconds, "core", MOST_CORES, "0.25"),
        Figure("worker, standing", stands.worker_s / stands.seconds, "core"),
        Figure("worker, navigating, resident", navigates.worker_mb, "MB", MOST_MB),
        Figure("daemon, navigating", navigates.daemon_s / navigates.seconds, "core"),
        Figure("daemon, by hand", by_hand.daemon_s / by_hand.seconds, "core"),
        *_latencies("get_state", "standing", stands.calls_s, navigates.calls_s),
        *_latencies("encoders to s", "by hand", by_hand.answers_s, navigates.answers_s),
        Figure("control steps missed", missed, "steps", 0),
    )
    return Outcome(figures, faults=(f"{missed} control steps missed",) if missed else ())


def _latencies(name: str, told: str, idle_s: list[float], navigating_s: list[float]) -> Iterator[Figure]:
    ratio = percentile(navigating_s, 99) / percentile(idle_s, 99)
    yield Figure(f"{name}, p99, navigating over {told}", ratio, "x", RATIO)
    for doing, seconds in ((told, idle_s), ("navigating", navigating_s)):
        for p in (50, 99):
            yield Figure(f"{name}, p{p}, {doing}, of {len(seconds)}", 1e3 * percentile(seconds, p), "ms")


def _measure(
    phase: Phase, robot: Daemon, caller: Caller, wire: Tap, seconds: float, keep: Callable[[], None]
) -> None:
    """Ask all the time for so long; ``keep`` has the robot do what it is to do."""
    keep()
    time.sleep(SETTLE_S)
    worker, pause = _worker(robot), random.Random(1)
    wire.collect()
    began_s, worker_s, daemon_s = time.monotonic(), _cpu_s(worker), robot.cpu_s()
    steps = caller.call("get_stats")["control_steps"]
    while time.monotonic() - began_s < seconds:
        sent_ns, _ = caller.timed_call("get_state")
        phase.calls_s.append((time.monotonic_ns() - sent_ns) * 1e-9)
        caller.discard(pause.uniform(*ASKED_EVERY_S))
        keep()
    phase.seconds += time.monotonic() - began_s
    phase.worker_s += _cpu_s(worker) - worker_s
    phase.daemon_s += robot.cpu_s() - daemon_s
    phase.worker_mb = max(phase.worker_mb, worker.memory_info().rss / 1e6)
    steps = caller.call("get_stats")["control_steps"] - steps
    journal = wire.collect()
    phase.missed += max(len(journal.encoder_frames_ns) - steps - ON_ITS_WAY, 0)
    phase.answers_s += answers_s(journal.encoder_frames_ns, journal.commands)


def _keep_driving(caller: Caller, goals: Iterator[str]) -> None:
    """Send it to the next place when it has none to go to."""
    told = _topic(caller, "navigation")
    if told is None or told["state"] == "idle":
        place = next(goals)
        until(lambda: sent(caller, "navigate_to", place=place), "it takes no goal")


def _turn(caller: Caller) -> None:
    """On a busy machine a command may be too old before it is read; the next one follows."""
    sent(caller, "drive", linear_m_s=0.0, angular_rad_s=TURN_RAD_S)


@contextmanager
def _serving() -> Iterator[tuple[Daemon, Caller, Tap]]:
    """A robot that knows where it is, in a map with two places."""
    with tempfile.TemporaryDirectory(prefix="chefbotd-bench-") as folder:
        here, port = Path(folder), reserve_port()
        config = here / "robot.toml"
        config.write_text(to_toml(_configured(here)))
        with _simulated(config, here / "board"), tap(here / "board") as wire:
            command = [*CHEFBOTD, "run", "--config", str(config), "--port", wire.device]
            command += ["--listen", f"127.0.0.1:{port}"]
            with running(command, port) as robot, connect(robot, READY_S) as caller:
                _find_itself(caller)
                yield robot, caller, wire


def _configured(folder: Path) -> dict[str, Any]:
    values = read_values(packaged(ROBOT))
    values["lidar"][0]["device"] = str(folder / "board-lidar")
    values["maps"] = {"folder": str(folder / "maps")}
    start = {"start_x_m": START.x_m, "start_y_m": START.y_m, "start_heading_rad": START.heading_rad}
    values["sim"] = {"world": {"map_path": "flat", **start}}
    values["watchdog"] = {"timeout_s": WATCHDOG_S}
    values["safety"]["encoders"] = {"latch_after_s": HELD_UP_S}
    return values


@contextmanager
def _simulated(config: Path, link: Path) -> Iterator[None]:
    """The simulated robot in a process of its own; its board is at the link, its lidar beside it."""
    options = ["simulate", "--config", str(config), "--link", str(link), "--cycle-hz", str(CYCLE_HZ)]
    with subprocess.Popen(
        [*CHEFBOTD, *options],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,  # Linux then shares the processor with it as with another program
    ) as process:
        assert process.stdout is not None
        try:
            for _ in ("board", "lidar"):
                process.stdout.readline()
            yield
        finally:
            process.terminate()


def _find_itself(caller: Caller) -> None:
    until(lambda: (_topic(caller, "worker") or {}).get("state") == "ready", "no worker is ready", READY_S)
    caller.call("import_map", yaml=str(MAP), name="flat")
    for name in PLACES:
        pose = ALL_PLACES[name]
        at = {"x_m": pose.x_m, "y_m": pose.y_m, "heading_rad": pose.heading_rad}
        caller.call("save_place", name=name, map="flat", **at)
    caller.call("load_map", name="flat")
    caller.call("set_pose", x_m=START.x_m, y_m=START.y_m, heading_rad=START.heading_rad)
    until(
        lambda: (_topic(caller, "localization") or {}).get("state") == "localized",
        "it is not localized",
        FOUND_S,
    )


def _topic(caller: Caller, topic: str) -> dict[str, Any] | None:
    told: dict[str, Any] | None = caller.call("get_state")["topics"].get(topic)
    return None if told is None else told["data"]


def _worker(robot: Daemon) -> psutil.Process:
    children = psutil.Process(robot.process.pid).children()
    return next(each for each in children if "chefbotd.components.worker" in each.cmdline())


def _cpu_s(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)
