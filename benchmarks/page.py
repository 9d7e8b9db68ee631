"""What the page costs: its bytes, its first paint, what a client at full view takes, and a command's way to the wire.

Commands go over the WebSocket and over TCP by turns, in the same daemon; the difference is the page's own. What a client
takes is the daemon's processor time with several of them over that without any, by turns, on a simulated robot with a
lidar, whose scans and map are most of what is sent.
"""

import shutil
import statistics
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks import rig
from benchmarks.board import board
from benchmarks.figures import Figure, Outcome, percentile
from benchmarks.latency import CYCLE_S, ECHO_S, command_to_wire
from benchmarks.rpc import WebCaller
from chefbotd.transport.ports import reserve_port
from chefbotd.transport.web.server import page_files

COMMANDS_A_TURN, TURNS = 40, 5
CLIENTS, SECONDS_A_TURN = 5, 5.0
FAST = ["odometry", "wheels", "ranges", "scan", "map_pose"]
SLOW = [
    "safety",
    "battery",
    "link",
    "lidars",
    "worker",
    "localization",
    "mapping",
    "map",
    "navigation",
    "path",
]
RATE_HZ = 10
PAINTS = 5
PAINT = "first-contentful-paint"


def run(*, quick: bool = False) -> Outcome:
    """Bytes, the latencies of both transports and their difference, processor time a client, first paint."""
    size = sum(len(file.body) for path, file in page_files().items() if path != "/")
    figures = [Figure("bytes of the page", size / 1e3, "kB", 300)]
    figures += _latencies(10 if quick else COMMANDS_A_TURN)
    with _simulated() as running:
        figures.append(
            Figure("a client at full view, 10 Hz", _cost(running, 2 if quick else TURNS), "core", 0.02)
        )
        paints_s, remarks = _first_paints_s(running, 2 if quick else PAINTS)
    if paints_s:
        figures.append(Figure("first paint, median", statistics.median(paints_s), "s", 0.5))
    return Outcome(tuple(figures), remarks=remarks)


def _latencies(commands: int) -> list[Figure]:
    """From ``drive`` to the first ``s`` that moves, over TCP and over the WebSocket."""
    page_port, seconds = reserve_port(), {"TCP": list[float](), "WebSocket": list[float]()}
    changes = {"page": {"enabled": True, "port": page_port}}
    with (
        board() as instrument,
        rig.daemon(instrument.device, changes) as running,
        rig.connect(running) as tcp,
        WebCaller(page_port) as web,
    ):
        instrument.start(CYCLE_S, echo_s=ECHO_S)
        for _ in range(TURNS):
            for name, caller in (("TCP", tcp), ("WebSocket", web)):
                seconds[name] += command_to_wire(instrument, caller, commands)[0]
                caller.call("release_control")
    figures = []
    for percent, beyond_ms in ((50, 5), (99, 20)):
        tcp_ms, web_ms = (1e3 * percentile(seconds[name], percent) for name in ("TCP", "WebSocket"))
        figures += [
            Figure(f"drive to first s, p{percent}, over TCP", tcp_ms, "ms"),
            Figure(f"drive to first s, p{percent}, over the WebSocket", web_ms, "ms"),
            Figure(f"drive to first s, p{percent}, beyond TCP's", web_ms - tcp_ms, "ms", beyond_ms),
        ]
    return figures


@contextmanager
def _simulated() -> Iterator[rig.Daemon]:
    """A simulated robot with a lidar in a flat, that serves the page on the port after its own."""
    with TemporaryDirectory(prefix="chefbotd-bench-") as folder:
        port, page_port = reserve_port(), reserve_port()
        config = Path(folder, "robot.toml")
        config.write_text(f'extends = "chefbot_lidar"\n[api]\nport = {port}\n[page]\nport = {page_port}\n')
        command = [*rig.CHEFBOTD, "run", "--sim", "--page", "--config", str(config)]
        with rig.running(command, port, page_port) as running:
            rig.connect(running).call("arm")
            yield running


def _cost(running: rig.Daemon, turns: int) -> float:
    """Processor time of the daemon for each client, as a share of a core; turns with clients and without."""
    with_s, without_s = list[float](), list[float]()
    for _ in range(turns):
        with ExitStack() as stack:
            clients = [stack.enter_context(WebCaller(running.page_port)) for _ in range(CLIENTS)]
            for client in clients:
                client.call("subscribe", topics=FAST, max_rate_hz=RATE_HZ)
                client.call("subscribe", topics=SLOW)
            with_s.append(_used_s(running, clients))
        without_s.append(_used_s(running, []))
    return (statistics.mean(with_s) - statistics.mean(without_s)) / CLIENTS / SECONDS_A_TURN


def _used_s(running: rig.Daemon, readers: list[WebCaller]) -> float:
    """Processor seconds of one turn, while the clients read."""
    threads = [threading.Thread(target=reader.read_for, args=(SECONDS_A_TURN,)) for reader in readers]
    pause = threading.Event()
    before_s = running.cpu_s()
    for thread in threads:
        thread.start()
    pause.wait(SECONDS_A_TURN)
    used_s = running.cpu_s() - before_s
    for thread in threads:
        thread.join()
    return used_s


def _first_paints_s(running: rig.Daemon, paints: int) -> tuple[list[float], tuple[str, ...]]:
    """From the navigation to the first paint with content, in a tab of its own each; none without a browser."""
    chromium = shutil.which("chromium")
    with suppress(ImportError):
        from playwright.sync_api import sync_playwright

        if chromium is not None:
            with sync_playwright() as playwright:
                browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
                return [_first_paint_s(browser, running.page_port) for _ in range(paints)], ()
    return [], ("first paint was not measured: there is no chromium, or playwright is not installed",)


def _first_paint_s(browser: object, port: int) -> float:
    context = browser.new_context()  # type: ignore[attr-defined]
    tab = context.new_page()
    tab.goto(f"http://127.0.0.1:{port}/")
    tab.wait_for_function(f"performance.getEntriesByName({PAINT!r}).length")
    milliseconds: float = tab.evaluate(f"performance.getEntriesByName({PAINT!r})[0].startTime")
    context.close()
    return milliseconds / 1e3
