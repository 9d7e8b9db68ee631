"""What looking through the camera costs: processor time a viewer, the picture's age, memory for those who stall.

The camera is a program that writes the same picture of 96 kB, 15 times a second. Viewers ask for one picture after the
other over the page's WebSocket; stalled ones ask as often as they can, and read nothing. The board reports at 100 Hz
meanwhile, and each of its frames must be answered by a control step.
"""

import io
import json
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from benchmarks.board import board
from benchmarks.figures import Figure, Outcome, percentile
from benchmarks.latency import ECHO_S, FRAMES_CYCLE_S, frame_to_answer
from benchmarks.rig import Changes, Daemon, connect, daemon
from benchmarks.rpc import CallFailed, WebCaller
from chefbotd.clock import SystemClock
from chefbotd.transport.ports import reserve_port

PICTURE_BYTES, RATE_HZ = 96_000, 15
VIEWERS, STALLED, TURNS, SECONDS_A_TURN = 4, 10, 3, 8.0
MOST_CORE, MOST_AGE_S, MOST_STALLED_MB = 0.01, 0.3, 5.0
PROGRAM = (
    "import sys, time\npicture = open(sys.argv[1], 'rb').read()\n"
    f"while True:\n    sys.stdout.buffer.write(picture); sys.stdout.flush(); time.sleep(1 / {RATE_HZ})\n"
)


def run(*, quick: bool = False) -> Outcome:
    """A viewer's share of a core, ages, memory for ten that stall, and control steps that were missed."""
    turns, seconds = (1, 4.0) if quick else (TURNS, SECONDS_A_TURN)
    with tempfile.TemporaryDirectory(prefix="chefbotd-camera-") as folder:
        changes, page_port = _changes(Path(folder))
        with board() as instrument, daemon(instrument.device, changes) as running, connect(running) as caller:
            instrument.start(FRAMES_CYCLE_S, echo_s=ECHO_S)
            time.sleep(3.0)  # the schemas for ``describe`` are built
            alone, looked, ages_s = list[float](), list[float](), list[float]()
            for _ in range(turns):
                alone.append(_used(running, seconds))
                with _viewers(page_port, VIEWERS, ages_s):
                    looked.append(_used(running, seconds))
            with _viewers(page_port, VIEWERS, []):
                with _watched(running) as before_mb:
                    time.sleep(seconds / 2)
                with _watched(running) as most_mb, _stalled(running, STALLED):
                    answers = frame_to_answer(instrument, caller, seconds)
            caller.call("stop")
    share = (percentile(looked, 50) - percentile(alone, 50)) / VIEWERS
    late = sum(answer > FRAMES_CYCLE_S for answer in answers)
    steps = round(seconds / FRAMES_CYCLE_S)
    return Outcome(
        (
            Figure(
                f"a viewer of {PICTURE_BYTES // 1000} kB at {RATE_HZ} Hz, of {VIEWERS}",
                share,
                "core",
                MOST_CORE,
            ),
            Figure("the picture's age at the viewer, p50", 1e3 * percentile(ages_s, 50), "ms"),
            Figure(
                "the picture's age at the viewer, p99", 1e3 * percentile(ages_s, 99), "ms", 1e3 * MOST_AGE_S
            ),
            Figure(
                f"memory for {STALLED} stalled viewers", max(most_mb) - max(before_mb), "MB", MOST_STALLED_MB
            ),
            Figure(f"control steps without an answer, of {steps}", max(steps - len(answers) - 2, 0), "", 0.0),
            Figure("control steps answered later than a cycle", late, ""),
            Figure("encoders to s with viewers and stalled ones, p99", 1e3 * percentile(answers, 99), "ms"),
        )
    )


def _changes(folder: Path) -> tuple[Changes, int]:
    (folder / "picture.jpg").write_bytes(_picture())
    (folder / "program.py").write_text(PROGRAM)
    page_port = reserve_port()
    command = [sys.executable, str(folder / "program.py"), str(folder / "picture.jpg")]
    return {
        "page": {"enabled": True, "port": page_port},
        "camera": {
            "enabled": True,
            "source": "command",
            "command": command,
            "rate_hz": 30.0,
            "max_viewers": 100,
        },
    }, page_port


def _picture() -> bytes:
    """A small picture with comments in its head, up to its size."""
    from PIL import Image

    data = io.BytesIO()
    Image.new("RGB", (640, 480)).save(data, "JPEG")
    jpeg = data.getvalue()
    rest = PICTURE_BYTES - len(jpeg)
    comments = b""
    while rest > 0:
        length = min(rest, 65_000)
        comments += b"\xff\xfe" + length.to_bytes(2, "big") + bytes(length - 2)
        rest -= length
    return jpeg[:2] + comments + jpeg[2:]


def _used(running: Daemon, seconds: float) -> float:
    began_s, before_s = time.monotonic(), running.cpu_s()
    time.sleep(seconds)
    return (running.cpu_s() - before_s) / (time.monotonic() - began_s)


@contextmanager
def _viewers(page_port: int, count: int, ages_s: list[float]) -> Iterator[None]:
    """Viewers that read each picture as soon as it is there; what they cost is not the daemon's."""
    ending = threading.Event()

    def look(viewer: WebCaller) -> None:
        number, clock = 0, SystemClock()
        while not ending.is_set():
            try:
                frame = viewer.call("get_camera_frame", after=number)
            except CallFailed:  # it starts
                time.sleep(0.1)
                continue
            ages_s.append(clock.now_s() - frame["stamp_s"])
            number = frame["number"]

    with ExitStack() as stack:
        viewers = [stack.enter_context(WebCaller(page_port)) for _ in range(count)]
        threads = [threading.Thread(target=look, args=(viewer,)) for viewer in viewers]
        for thread in threads:
            thread.start()
        time.sleep(1.0)
        ages_s.clear()
        try:
            yield
        finally:
            ending.set()
            for thread in threads:
                thread.join()


@contextmanager
def _watched(running: Daemon) -> Iterator[list[float]]:
    """The daemon's memory in MB, ten times a second."""
    ending, seen_mb = threading.Event(), [running.resident_mb()]

    def watch() -> None:
        while not ending.wait(0.1):
            seen_mb.append(running.resident_mb())

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield seen_mb
    finally:
        ending.set()
        thread.join()


@contextmanager
def _stalled(running: Daemon, count: int) -> Iterator[None]:
    """Viewers that ask and read nothing, and come again when they are disconnected."""
    ending = threading.Event()
    line = json.dumps({"jsonrpc": "2.0", "id": 1, "method": "get_camera_frame"}).encode() + b"\n"

    def stall() -> None:
        while not ending.is_set():
            with socket.create_connection(("127.0.0.1", running.port)) as connection:
                connection.settimeout(0.2)
                for _ in range(30):
                    try:
                        connection.sendall(line)
                    except OSError:
                        break
                    if ending.wait(0.2):
                        break

    threads = [threading.Thread(target=stall) for _ in range(count)]
    for thread in threads:
        thread.start()
    time.sleep(1.0)
    try:
        yield
    finally:
        ending.set()
        for thread in threads:
            thread.join()
