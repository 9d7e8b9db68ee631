"""The page in a real browser, before the real program on the simulated robot, or before a daemon of the tests."""

import json
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

import pytest

from chefbotd.client import SyncClient
from chefbotd.component_list import own_components
from chefbotd.composition.network import cards_of
from chefbotd.transport.ports import reserve_port
from tests.robot_files import full
from tests.waiting import PATIENCE_S

HERE = all(map(find_spec, ("playwright", "axe_playwright_python", "aiohttp")))
if HERE:
    from axe_playwright_python.sync_playwright import Axe
    from playwright import sync_api

    sync_api.expect.set_options(timeout=1000 * PATIENCE_S)
CHROMIUM = shutil.which("chromium")
NEEDS_BROWSER = pytest.mark.skipif(
    CHROMIUM is None or not HERE,
    reason="the page needs a browser (apt-get install chromium) and the extras 'dev' and 'page'",
)
PATIENCE_MS = 1000 * PATIENCE_S
MOVES_M_S, STANDS_M_S = 0.05, 0.01
PROGRAM = [sys.executable, "-c", "from chefbotd.start import chefbotd; chefbotd()"]
OWN_TOKEN = "o" * 32
"""Of the test itself, beside that of who looks at the page."""


class RunningRobot:
    """``chefbotd run --sim --page`` on ports of its own, which stay the same after a restart."""

    def __init__(
        self,
        folder: Path,
        *,
        token: str | None = None,
        role: str = "admin",
        name: str = "chefbot",
        device: Path | None = None,
        origins: Sequence[str] = (),
        allow: str = "",
        more: str = "",
    ) -> None:
        self.api_port, self.page_port, self.token = reserve_port(), reserve_port(), token
        self._board = ["--sim"] if device is None else ["--port", str(device)]
        text = full(name).read_text()
        for old, new in (("port = 7333", self.api_port), ("port = 7380", self.page_port)):
            assert old in text
            text = text.replace(old, f"port = {new}")
        if token is not None:
            tokens = folder / "tokens"
            tokens.write_text(f"{role} {token}\nadmin {OWN_TOKEN}\n")
            tokens.chmod(0o600)
            text = text.replace("[api]\n", f'[api]\ntoken_file = "{tokens}"\n')
        if origins:
            text = text.replace("[page]\n", f"[page]\norigins = {json.dumps(list(origins))}\n")
        self._configuration, self._log_path = folder / "robot.toml", folder / "log"
        if allow:
            text = text.replace("[plugins]\n", f'[plugins]\nallow = ["{allow}"]\n')
        self._configuration.write_text(text + more)
        self.start()

    def start(self) -> None:
        """Start the program, and wait until the command socket answers."""
        with self._log_path.open("ab") as log:
            self.process = subprocess.Popen(
                [*PROGRAM, "run", *self._board, "--page", "--config", str(self._configuration)],
                stdout=log,
                stderr=log,
            )
        try:
            with self.client() as robot:
                robot.wait_until_armed(PATIENCE_S)
        except BaseException:
            self.end(signal.SIGKILL)
            raise

    def client(self) -> SyncClient:
        """A client of the command socket; the program has a while to begin listening."""
        ends_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < ends_s:
            try:
                return SyncClient.connect("127.0.0.1", self.api_port, token=self.token and OWN_TOKEN)
            except OSError:
                assert self.process.poll() is None, self.log
                time.sleep(0.1)
        raise TimeoutError(self.log)

    def end(self, number: int = signal.SIGINT) -> None:
        """End the program by a signal."""
        self.process.send_signal(number)
        self.process.wait(PATIENCE_S)

    @property
    def url(self) -> str:
        """The page's address."""
        return f"http://127.0.0.1:{self.page_port}/"

    @property
    def log(self) -> str:
        """What the program has said."""
        return self._log_path.read_text()


@contextmanager
def page_alone() -> Iterator[str]:
    """The address of the page with the cards of all our components, without a robot behind it."""
    from chefbotd.transport.web.server import HEADERS, page_files

    parts = [(component.name, part) for component in own_components() for part in component.page]
    files = page_files(cards_of(parts))

    class Files(BaseHTTPRequestHandler):
        """Answers with a file of the page."""

        def do_GET(self) -> None:
            """Any other path is not found."""
            file = files.get(self.path)
            self.send_response(HTTPStatus.OK if file else HTTPStatus.NOT_FOUND)
            for name, value in {
                **HEADERS,
                "Content-Type": file.content_type if file else "text/plain",
            }.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(file.body if file else b"")

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Files) as server:
        threading.Thread(target=server.serve_forever).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()


def open_page(page: Any, robot: RunningRobot) -> None:
    """Open it, and wait until the robot can be driven."""
    page.goto(robot.url)
    mode_is(page, "Ready to drive")
    page.locator("h1").click()  # the tab has the focus now


def show(page: Any, panel: str) -> None:
    """Have a panel open: drive, goals, map, camera, programs, lately, people or workshop."""
    tab = page.locator(f"#tab-{panel}")
    sync_api.expect(tab).to_be_visible()
    if tab.get_attribute("aria-expanded") != "true":
        tab.click()


def mode_is(page: Any, words: "str | re.Pattern[str]") -> None:
    """Wait for the word of the safety mode."""
    sync_api.expect(page.locator("#mode-word")).to_have_text(words, timeout=PATIENCE_MS)


def until(happens: Callable[[], bool], within_s: float = PATIENCE_S) -> bool:
    """Whether something happens in time."""
    end_s = time.monotonic() + within_s
    while time.monotonic() < end_s:
        if happens():
            return True
        time.sleep(0.05)
    return happens()


def speed_m_s(robot: SyncClient) -> float:
    """How fast the robot is, by its odometry."""
    return float(robot.get_state().odometry.linear_m_s)


def moves(robot: SyncClient, direction: int = 1) -> bool:
    """Whether the robot begins to drive forward (1) or backward (-1) in time."""
    return until(lambda: direction * speed_m_s(robot) > MOVES_M_S)


def comes_to_rest(robot: SyncClient) -> bool:
    """Whether the robot stands in time."""
    return until(lambda: abs(speed_m_s(robot)) < STANDS_M_S)


def stays_at_rest(robot: SyncClient) -> bool:
    """Whether the robot stands after half a second."""
    time.sleep(0.5)
    return abs(speed_m_s(robot)) < STANDS_M_S


def only_a_new_press_drives(page: Any, robot: SyncClient, key: str = "KeyW") -> bool:
    """Whether a key that has been down all the time drives nothing, and the next press of it does."""
    rested = stays_at_rest(robot)
    page.keyboard.up(key)
    page.keyboard.down(key)
    return rested and moves(robot)


class FakeDaemon:
    """The other end of the page's WebSocket: a robot that finds its way, and remembers what it was asked."""

    METHODS = (
        *("drive", "stop", "estop", "arm", "navigate_to", "set_pose", "cancel_navigation"),
        *("list_places", "save_place", "delete_place", "list_maps", "start_mapping", "localize"),
        *("follow_waypoints", "pause_navigation", "resume_navigation", "discard_mapping", "finish_mapping"),
        *("save_ring", "start_recording", "stop_recording", "press_button", "answer_agent"),
    )
    TOPICS = (
        "odometry",
        "safety",
        "map_pose",
        "map",
        "path",
        "navigation",
        "scan",
        "localization",
        "costmap",
        *(
            "mapping",
            "recording",
            "battery",
            "link",
            "firmware",
            "lidars",
            "ranges",
            "reset",
            "log",
            "agents",
        ),
    )
    RESULTS: ClassVar[dict[str, Any]] = {
        "list_places": {
            "map": "flat",
            "places": [
                {"name": "kitchen", "x_m": 1.5, "y_m": -0.25, "heading_rad": 2.0},
                {"name": "table 3", "x_m": 3.0, "y_m": 4.0, "heading_rad": 0.5},
            ],
        },
        "list_maps": {"in_use": None, "maps": []},
        "localize": {"state": "localized", "map": "flat", "reason": "it knows where it is"},
    }

    def __init__(self, page: Any) -> None:
        self.asked: list[tuple[str, dict[str, Any]]] = []
        self._socket: Any = None
        self._more: tuple[str, ...] = ()
        self._page = page
        self.refusal: dict[str, Any] | None = None  # the answer to everything that is not in RESULTS
        self.held: set[str] = set()  # methods whose requests wait for ``answer``
        self._waiting: list[tuple[str, int, Any]] = []
        page.route_web_socket(re.compile("/socket$"), self._connected)

    def _connected(self, socket: Any) -> None:
        self._socket = self._socket or socket
        socket.on_message(partial(self._take, socket))
        capabilities = [f"method.{name}" for name in (*self.METHODS, *self._more)] + [
            f"topic.{name}" for name in self.TOPICS
        ]
        hello = {"robot": "fake", "auth": "none", "capabilities": capabilities}
        socket.send(json.dumps({"jsonrpc": "2.0", "method": "hello", "params": hello}))

    def _take(self, socket: Any, line: str) -> None:
        request = json.loads(line)
        if request.get("params", {}).get("client", "").startswith("page #"):
            self._socket = socket  # of the page itself: a card may have a connection of its own
        self.asked.append((request["method"], request.get("params", {})))
        method, number = request["method"], request.get("id")
        if method in self.held:
            self._waiting.append((method, number, socket))
        elif number is not None:
            refused = self.refusal if method not in (*self.RESULTS, "subscribe", "ping") else None
            answer = {"error": refused} if refused else {"result": self.RESULTS.get(method, {})}
            self._answer(number, answer, socket)

    def _answer(self, number: int, answer: dict[str, Any], socket: Any) -> None:
        socket.send(json.dumps({"jsonrpc": "2.0", "id": number, **answer}))

    def answer(self, method: str, **result: Any) -> None:
        """Answer the oldest request of a method in ``held``."""
        assert until(lambda: self.was_asked(method))
        first = next(each for each in self._waiting if each[0] == method)
        self._waiting.remove(first)
        self._answer(first[1], {"result": result}, first[2])

    def capable_of(self, *methods: str) -> None:
        """Offer more methods; before the page is opened."""
        self._more = methods

    def waits(self, method: str) -> bool:
        """Whether a request of a method in ``held`` has come and is not answered."""
        self._page.wait_for_timeout(50)
        return any(name == method for name, _, _ in self._waiting)

    def disconnect(self) -> None:
        """End the connection; the page comes back by itself."""
        self._waiting.clear()
        self._socket.close()

    def _send(self, method: str, params: dict[str, Any]) -> None:
        self._socket.send(json.dumps({"jsonrpc": "2.0", "method": method, "params": params}))

    def say(self, topic: str, *, stamp_s: float = 1.0, age_s: float = 0.0, **data: Any) -> None:
        """Send an event, of which there are none before the page has asked for them."""
        assert until(lambda: self.was_asked("subscribe"))
        self._send("event", {"topic": topic, "seq": 1, "stamp_s": stamp_s, "age_s": age_s, "data": data})

    def was_asked(self, method: str) -> bool:
        """Whether a request of a method has come; playwright hands messages over only while it is called."""
        self._page.wait_for_timeout(50)
        return any(name == method for name, _ in self.asked)

    def last(self, method: str) -> dict[str, Any]:
        """The parameters of the latest request of a method; waits until there is one."""
        assert until(lambda: self.was_asked(method)), f"{method} was not asked"
        return [params for name, params in self.asked if name == method][-1]

    def opened(self, url: str) -> None:
        """Have the page open on this daemon with every card, in the light scheme."""
        self._page.goto(url)
        sync_api.expect(self._page.locator(".card:empty")).to_have_count(0)
        sync_api.expect(self._page.locator("#robot")).to_have_text("fake")
        self._page.emulate_media(color_scheme="light")


def pixel(page: Any, x: float, y: float) -> list[int]:
    """The colour of the view at a place of the window."""
    script = """([x, y]) => { const box = view.getBoundingClientRect();
      return [...view.getContext("2d").getImageData(x - box.x, y - box.y, 1, 1).data].slice(0, 3); }"""
    colour: list[int] = page.evaluate(script, [x, y])
    return colour


def middle_of_view(page: Any) -> tuple[float, float]:
    """Where the robot is drawn, in the window: in the middle of what no panel covers."""
    box = page.locator("#room").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def barriers(page: Any) -> list[tuple[str, str]]:
    """What axe finds: its rule, and the first element that breaks it."""
    found = Axe().run(page).response["violations"]
    return [(each["id"], each["nodes"][0]["html"]) for each in found]
