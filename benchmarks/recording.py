"""What recording costs: control's latency and the processor, with and without it, by turns.

The board reports at 100 Hz and a lidar sends ten scans a second; the robot drives. Recorded is everything, from the
daemon's start on, beside the ring. At the end the file is read back: nothing may be missing in it.
"""

import itertools
import tempfile
import time
from pathlib import Path

from benchmarks.board import board
from benchmarks.figures import Figure, Outcome, percentile
from benchmarks.latency import ECHO_S, FRAMES_CYCLE_S, frame_to_answer
from benchmarks.rig import Changes, connect, daemon
from benchmarks.rpc import Caller
from benchmarks.worker import lidar
from chefbotd.components.recording.reader import RecordingReader

ROUNDS, FRAMES, IDLE_S = 5, 1500, 10.0
MOST_CORES, RATIO, MOST_IDLE_CORES = 0.02, 1.1, 0.03
IDLE_CYCLE_S = 0.05
BEFORE_IDLE_S = 6.0
"""The schemas for ``describe`` are built in the seconds after the start, one at a time."""


def run(*, quick: bool = False) -> Outcome:
    """The ratio of the 99th percentiles, the cores more, and the idle daemon's with its ring."""
    rounds, frames, idle_s = (2, 500, 3.0) if quick else (ROUNDS, FRAMES, IDLE_S)
    answers: dict[bool, list[float]] = {False: [], True: []}
    cores: dict[bool, list[float]] = {False: [], True: []}
    faults: list[str] = []
    with lidar() as device, tempfile.TemporaryDirectory(prefix="chefbotd-recordings-") as folder:
        for number, records in itertools.product(range(rounds), (False, True)):
            here = Path(folder, str(number))
            took, used = _measured(_changes(device, here, records=records), frames)
            answers[records] += took
            cores[records].append(used)
            if records:
                faults += _missing(here, frames)
    idle = {records: _idle(records=records, seconds=idle_s) for records in (False, True)}
    more = [beside - alone for alone, beside in zip(cores[False], cores[True], strict=True)]
    ratio = percentile(answers[True], 99) / percentile(answers[False], 99)
    return Outcome(
        (
            Figure(
                "recording at 100 Hz and 10 scans/s: more of a core", percentile(more, 50), "core", MOST_CORES
            ),
            Figure("encoders to s, p99, recording over not", ratio, "x", RATIO),
            *(
                Figure(f"encoders to s, p{p:g}, {name}", 1e3 * percentile(answers[records], p), "ms")
                for name, records in (("not recording", False), ("recording", True))
                for p in (50, 99)
            ),
            Figure("daemon, not recording", percentile(cores[False], 50), "core"),
            Figure("daemon, recording", percentile(cores[True], 50), "core"),
            Figure("idle at 20 Hz, with the ring", idle[True], "core", MOST_IDLE_CORES),
            Figure("idle at 20 Hz, without", idle[False], "core"),
        ),
        faults=tuple(faults),
    )


def _changes(device: str, folder: Path, *, records: bool) -> Changes:
    return {
        "lidar": [{"name": "top", "model": "ld19", "device": device, "guards": False}],
        "worker": {"enabled": False},
        "recording": {"enabled": records, "auto_start": True, "folder": str(folder), "min_free_mb": 0.0},
    }


def _measured(changes: Changes, frames: int) -> tuple[list[float], float]:
    """Seconds from each encoder frame to its motor command, and processor seconds a second."""
    with board() as instrument, daemon(instrument.device, changes) as running, connect(running) as caller:
        instrument.start(FRAMES_CYCLE_S, echo_s=ECHO_S)
        began_s, before_s = time.monotonic(), running.cpu_s()
        answers = frame_to_answer(instrument, caller, frames * FRAMES_CYCLE_S)
        used = (running.cpu_s() - before_s) / (time.monotonic() - began_s)
        _settle(caller)
    return answers, used


def _settle(caller: Caller) -> None:
    """Stand still for a moment, so that the next daemon finds a board at rest."""
    caller.call("stop")
    time.sleep(0.3)


def _idle(*, records: bool, seconds: float) -> float:
    """Processor seconds a second of a robot that stands, with nobody watching."""
    with (
        board() as instrument,
        daemon(instrument.device, {"recording": {"enabled": records}}) as running,
        connect(running),
    ):
        instrument.start(IDLE_CYCLE_S)
        time.sleep(BEFORE_IDLE_S)
        began_s, before_s = time.monotonic(), running.cpu_s()
        time.sleep(seconds)
        return (running.cpu_s() - before_s) / (time.monotonic() - began_s)


def _missing(folder: Path, frames: int) -> list[str]:
    """What is wrong with a recording."""
    found = [RecordingReader(path) for path in sorted(folder.glob("auto_*.mcap"))]
    names = [type(event).__name__ for reader in found for event in reader.events()]
    wrong = [f"{reader.path.name}: {reader.problem}" for reader in found if reader.problem]
    if (steps := names.count("WheelsDriven")) < frames:
        wrong.append(f"{steps} control steps are recorded, {frames} or more were made")
    if dropped := names.count("EventsDropped"):
        wrong.append(f"{dropped} gaps in the recording")
    return wrong
