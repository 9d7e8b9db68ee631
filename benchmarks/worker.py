"""Whether control is held up by SLAM: the board's encoder frames answered with and without it, by turns.

With it, the daemon has a lidar that sends ten turns a second and makes a map of it in its worker; beside it a process
of the worker's priority takes scans through SLAM's steps without a pause, as a worker does that is flat out.
"""

import contextlib
import itertools
import multiprocessing
import os
import pty
import tempfile
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.synchronize import Event

import numpy as np

from benchmarks.board import board
from benchmarks.figures import Figure, Outcome, percentile
from benchmarks.latency import ECHO_S, FRAMES_CYCLE_S, frame_to_answer
from benchmarks.rig import connect, daemon, until
from benchmarks.rpc import Caller
from chefbotd.components.mapping.algorithms.parameters import SlamParameters
from chefbotd.components.mapping.algorithms.slam import step
from chefbotd.components.mapping.algorithms.state import Scan, start
from chefbotd.components.mapping.algorithms.surfaces import normals
from chefbotd.components.mapping.algorithms.warm import warm
from chefbotd.components.worker.parameters import WorkerParameters
from tests.chefbotd.components.mapping.algorithms.slam.flat import (
    TOUR,
    Lidar,
    furnished_flat,
    odometry,
    poses_along,
)
from tests.fakes.lidar import ld19_packets, noisy_box

ROUNDS, FRAMES, RATIO = 5, 1000, 1.5
PERIOD_S = 0.01
READY_S = 240.0
CENTER = np.zeros(2)


def run(*, quick: bool = False) -> Outcome:
    """The ratio of the 99th percentiles, and what each was; the rounds take turns."""
    rounds, frames = (2, 300) if quick else (ROUNDS, FRAMES)
    without, beside = list[float](), list[float]()
    with lidar() as device, tempfile.TemporaryDirectory(prefix="chefbotd-maps-") as folder:
        for _ in range(rounds):
            without += _answered({}, frames)
            row = {"name": "top", "model": "ld19", "device": device, "guards": False}
            with _flat_out():
                beside += _answered({"maps": {"folder": folder}, "lidar": [row]}, frames)
    ratio = percentile(beside, 99) / percentile(without, 99)
    told = (("without SLAM", without), ("with SLAM flat out", beside))
    return Outcome(
        (
            Figure("encoders to s, p99, with SLAM flat out over without", ratio, "x", RATIO),
            *(
                Figure(f"encoders to s, p{p:g}, {name}", 1e3 * percentile(seconds, p), "ms")
                for name, seconds in told
                for p in (50, 99)
            ),
        )
    )


def _answered(changes: dict[str, object], frames: int) -> list[float]:
    """Seconds from each encoder frame to its motor command, by a daemon of its own."""
    with board() as instrument, daemon(instrument.device, changes) as running, connect(running) as caller:
        instrument.start(FRAMES_CYCLE_S, echo_s=ECHO_S)
        if "lidar" in changes:
            until(lambda: _state(caller, "worker") == "ready", "the worker is not ready", READY_S)
            caller.call("discard_mapping")
            caller.call("start_mapping")
            until(lambda: _keyframes(caller) > 0, "no map is made")
        answers = frame_to_answer(instrument, caller, frames * FRAMES_CYCLE_S)
        if "lidar" in changes:
            caller.call("discard_mapping")
        return answers


def _state(caller: Caller, topic: str) -> str:
    return str(caller.call("get_state")["topics"][topic]["data"]["state"])


def _keyframes(caller: Caller) -> int:
    return int(caller.call("get_state")["topics"]["mapping"]["data"]["keyframes"])


@contextmanager
def _flat_out() -> Iterator[None]:
    """A process that takes scans through SLAM without a pause, once it has begun."""
    context = multiprocessing.get_context("spawn")
    begun, end = context.Event(), context.Event()
    process = context.Process(target=_map_for_ever, args=(begun, end), daemon=True)
    process.start()
    try:
        begun.wait(READY_S)
        yield
    finally:
        end.set()
        process.join(10.0)
        process.kill()


def _map_for_ever(begun: Event, end: Event) -> None:
    os.nice(WorkerParameters().niceness)
    warm()
    truth = poses_along(TOUR)
    lidar, driven = Lidar(furnished_flat(), 1), odometry(truth, 1)
    seen = [lidar.points(pose) for pose in truth]
    begun.set()
    for _ in itertools.count():
        state = start()
        for k, (points, pose) in enumerate(zip(seen, driven, strict=True)):
            if end.is_set():
                return
            state, _ = step(
                SlamParameters(), state, 0.1 * k, pose, Scan(points, normals(points, CENTER), CENTER)
            )


@contextmanager
def lidar() -> Iterator[str]:
    """An LD19 in an oblong room, on a pseudo-terminal; yields its device."""
    far, near = pty.openpty()
    tty.setraw(near)
    os.set_blocking(far, False)
    end = threading.Event()
    thread = threading.Thread(target=_turn, args=(far, end), daemon=True)
    thread.start()
    try:
        yield os.ttyname(near)
    finally:
        end.set()
        thread.join()
        os.close(far)
        os.close(near)


def _turn(far: int, end: threading.Event) -> None:
    """Packets in their own time, some at once, as a USB adapter hands them on; what nobody reads is let go."""
    began_s = time.monotonic()
    for at_s, packet in ld19_packets(noisy_box(ahead_m=3.1, left_m=2.2)):
        late_s = began_s + at_s - time.monotonic()
        if end.wait(PERIOD_S if late_s > PERIOD_S else 0.0):
            return
        with contextlib.suppress(BlockingIOError):
            os.write(far, packet)
