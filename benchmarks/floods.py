"""How long an e-stop takes to the board's wire while eight clients flood the same door: socket, page or rosbridge.

    python -m benchmarks.floods [--estops 50] [--floods 8]

The flooders, in a process of their own, send valid and odd requests as fast as they are taken, and read what comes.
Beside them a driver moves the robot, and one client after the other presses its stop. Its time is from the moment
before it is sent to the first command without duty that the board reads. rosbridge is left out where it is missing.
"""

import argparse
import contextlib
import json
import multiprocessing
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any

from rich.console import Console
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection
from websockets.sync.client import connect as connect_web

from benchmarks.board import Board, board
from benchmarks.figures import Figure, Outcome, percentile, table
from benchmarks.rig import Daemon, connect, daemon, sent, until
from benchmarks.rpc import Caller, CallFailed, WebCaller
from chefbotd.transport.ports import reserve_port

CYCLE_HZ = 50
FLOODS, ESTOPS = 8, 50
LIMIT_MS = 50.0
MOVES_AFTER_S = 0.3
"""So long the driver drives before each stop."""
SETTLES_S = 1.0
WORDS = ("ping", "get_state", "describe", "arm", "stop it", "subscribe")
REQUESTS = [json.dumps({"jsonrpc": "2.0", "id": 7, "method": word}) for word in WORDS] + ["no JSON", "[" * 50]
STOP_OF_ROSBRIDGE = {"op": "call_service", "service": "/estop", "id": "stop"}
ROSBRIDGE_WORDS = [
    *(json.dumps({"op": "call_service", "service": name, "id": "x"}) for name in ("/rosapi/topics", "/arm")),
    *(json.dumps({"op": "subscribe", "topic": topic}) for topic in ("/odom", "/scan")),
    '{"op":"nonsense"}',
    "no JSON",
]

Door = tuple[Callable[[], Callable[[], Any]], Callable[[], None]]
"""Connects a client and returns its stop; and floods from one client until the process is ended."""


def run(estops: int, floods: int) -> Outcome:
    """The times through each door, and what did not arrive."""
    page_port = reserve_port()
    changes = {"page": {"enabled": True, "port": page_port}}
    figures, faults = list[Figure](), list[str]()
    with (
        board() as instrument,
        daemon(instrument.device, changes) as running,
        connect(running, 100.0) as driver,
    ):
        instrument.start(1 / CYCLE_HZ)
        with contextlib.ExitStack() as stack:
            doors: dict[str, Door] = {
                "socket": (lambda: _socket_stop(running.port), partial(_flood_socket, running.port)),
                "page": (lambda: _page_stop(page_port), partial(_flood_page, page_port)),
            }
            if find_spec("chefbot_ros2"):
                port = stack.enter_context(_rosbridge(running))
                doors["rosbridge"] = (lambda: _rosbridge_stop(port), partial(_flood_rosbridge, port))
            for name, (stopper, flood) in doors.items():
                took_s, failed = _measure(instrument, driver, stopper, flood, estops, floods)
                faults += [f"{name}: {failure}" for failure in failed[:3]]
                if took_s:
                    figures += [
                        Figure(f"e-stop by {name}, p50", percentile(took_s, 50) * 1e3, "ms"),
                        Figure(f"e-stop by {name}, worst", max(took_s) * 1e3, "ms", LIMIT_MS),
                    ]
    left_out = () if find_spec("chefbot_ros2") else ("rosbridge is not installed: left out",)
    return Outcome(
        tuple(figures), (f"{estops} e-stops through each door, {floods} floods", *left_out), tuple(faults)
    )


def _measure(
    instrument: Board,
    driver: Caller,
    connect_stopper: Callable[[], Callable[[], Any]],
    flood: Callable[[], None],
    estops: int,
    floods: int,
) -> tuple[list[float], list[str]]:
    """The seconds of each e-stop to the wire, and what went wrong."""
    stop = connect_stopper()
    flooders = [multiprocessing.Process(target=_flood_by_threads, args=(flood, floods), daemon=True)]
    for flooder in flooders:
        flooder.start()
    time.sleep(SETTLES_S)
    took_s, failed = list[float](), list[str]()
    try:
        for number in range(estops):
            until(partial(sent, driver, "arm"), "it cannot be armed")
            with contextlib.suppress(CallFailed):  # too late on a busy computer: the next one counts
                driver.drive_for(MOVES_AFTER_S, 0.2, 0.0)
            instrument.collect()
            pressed_ns = time.monotonic_ns()
            stop()
            time.sleep(0.2)
            after_ns = [
                at for at, duty in instrument.collect().commands if at >= pressed_ns and not any(duty)
            ]
            if after_ns:
                took_s.append((after_ns[0] - pressed_ns) / 1e9)
            else:
                failed.append(f"e-stop {number} did not reach the board within 0.2 s of its answer")
    except (OSError, CallFailed, WebSocketException) as problem:
        failed.append(f"after {len(took_s)}: {problem!r}")
    finally:
        for flooder in flooders:
            flooder.terminate()
            flooder.join()
    return took_s, failed


def _flood_by_threads(flood: Callable[[], None], count: int) -> None:
    threads = [Thread(target=flood) for _ in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _socket_stop(port: int) -> Callable[[], Any]:
    caller = Caller(port)
    return partial(caller.call, "estop", reason="flooded")


def _page_stop(port: int) -> Callable[[], Any]:
    caller = WebCaller(port)
    return partial(caller.call, "estop", reason="flooded")


def _rosbridge_stop(port: int) -> Callable[[], Any]:
    web = connect_web(f"ws://127.0.0.1:{port}", compression=None, max_size=None)

    def stop() -> None:
        web.send(json.dumps(STOP_OF_ROSBRIDGE))
        while json.loads(web.recv(timeout=10.0)).get("id") != STOP_OF_ROSBRIDGE["id"]:
            pass

    return stop


def _flood_socket(port: int) -> None:
    """Send as fast as it is taken, and connect again when cut off."""
    import socket

    block = "".join(f"{request}\n" for request in REQUESTS * 20).encode()
    while True:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port)) as client:
            reader = Thread(target=_read_all, args=(client,), daemon=True)
            reader.start()
            while True:
                client.sendall(block)


def _read_all(client: Any) -> None:
    with contextlib.suppress(OSError):
        while client.recv(1 << 16):
            pass


def _flood_page(port: int) -> None:
    _flood_web(f"ws://127.0.0.1:{port}/socket", REQUESTS)


def _flood_rosbridge(port: int) -> None:
    _flood_web(f"ws://127.0.0.1:{port}", ROSBRIDGE_WORDS)


def _flood_web(url: str, words: list[str]) -> None:
    while True:
        with (
            contextlib.suppress(OSError, WebSocketException),
            connect_web(url, compression=None, max_size=None) as web,
        ):
            Thread(target=_read_web, args=(web,), daemon=True).start()
            while True:
                for word in words:
                    web.send(word)


def _read_web(web: ClientConnection) -> None:
    with contextlib.suppress(OSError, WebSocketException):
        while True:
            web.recv()


@contextlib.contextmanager
def _rosbridge(running: Daemon) -> Iterator[int]:
    """Its port, once it listens."""
    port = reserve_port()
    command = [sys.executable, "-P", "-m", "chefbot_ros2.rosbridge.server"]
    with TemporaryDirectory(prefix="chefbotd-floods-") as folder, Path(folder, "log").open("wb") as log:
        process = subprocess.Popen(
            [*command, "--connect", f"127.0.0.1:{running.port}", "--port", str(port)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
        )
        try:
            until(partial(_listens, port), "rosbridge does not listen", 100.0)
            yield port
        finally:
            process.terminate()
            process.wait(30.0)


def _listens(port: int) -> bool:
    with contextlib.suppress(OSError, WebSocketException):
        connect_web(f"ws://127.0.0.1:{port}", open_timeout=5.0).close()
        return True
    return False


def main() -> int:
    """Print the figures; exit code 1 where an e-stop did not arrive."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--estops", type=int, default=ESTOPS)
    parser.add_argument("--floods", type=int, default=FLOODS)
    options = parser.parse_args()
    outcome = run(options.estops, options.floods)
    Console().print(table({"floods": outcome}))
    sys.stderr.write("".join(f"{line}\n" for line in (*outcome.remarks, *outcome.faults)))
    return bool(outcome.faults)


if __name__ == "__main__":
    sys.exit(main())
