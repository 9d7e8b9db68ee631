"""The page in a real browser, before the real program on the simulated robot."""

import base64
import json
import math
import os
import re
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import psutil
import pytest

from chefbotd.client import SyncClient
from chefbotd.client.errors import CallError
from chefbotd.settings import packaged
from tests.fakes.api import free_port

axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe comes with the extra 'dev'")
sync_api = pytest.importorskip("playwright.sync_api", reason="playwright comes with the extra 'dev'")
pytest.importorskip("aiohttp", reason="the page needs the extra 'page'")
CHROMIUM = shutil.which("chromium")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.realtime,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no browser: apt-get install chromium"),
]
PATIENCE_MS = 20_000
MOVES_M_S, STANDS_M_S = 0.05, 0.01
MOST_BYTES = 300_000


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
    ) -> None:
        self.api_port, self.page_port, self.token = free_port(), free_port(), token
        self._board = ["--sim"] if device is None else ["--port", str(device)]
        text = packaged(name).read_text()
        for old, new in (("port = 7333", self.api_port), ("port = 7380", self.page_port)):
            assert old in text
            text = text.replace(old, f"port = {new}")
        if token is not None:
            tokens = folder / "tokens"
            tokens.write_text(f"{role} {token}\n")
            tokens.chmod(0o600)
            text = text.replace("[api]\n", f'[api]\ntoken_file = "{tokens}"\n')
        self._configuration, self._log_path = folder / "robot.toml", folder / "log"
        self._configuration.write_text(text)
        self.start()

    def start(self) -> None:
        """Start the program, and wait until the command socket answers."""
        command = [sys.executable, "-c", "from chefbotd.start import chefbotd; chefbotd()"]
        with self._log_path.open("ab") as log:
            self.process = subprocess.Popen(
                [*command, "run", *self._board, "--page", "--config", str(self._configuration)],
                stdout=log,
                stderr=log,
            )
        try:
            with self.client() as robot:
                robot.wait_until_armed(PATIENCE_MS / 1000)
        except BaseException:
            self.end(signal.SIGKILL)
            raise

    def client(self) -> SyncClient:
        """A client of the command socket; the program has a while to begin listening."""
        for _ in range(600):
            try:
                return SyncClient.connect("127.0.0.1", self.api_port, token=self.token)
            except OSError:
                assert self.process.poll() is None, self.log
                time.sleep(0.1)
        raise TimeoutError(self.log)

    def end(self, number: int = signal.SIGINT) -> None:
        """End the program by a signal."""
        self.process.send_signal(number)
        self.process.wait(20.0)

    @property
    def url(self) -> str:
        """The page's address."""
        return f"http://127.0.0.1:{self.page_port}/"

    @property
    def log(self) -> str:
        """What the program has said."""
        return self._log_path.read_text()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Debian's chromium without a window."""
    with sync_api.sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[RunningRobot]:
    """A robot without tokens."""
    running = RunningRobot(tmp_path)
    yield running
    running.end()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningRobot]:
    """A robot whose page is opened before a ``FakeDaemon``: one for all such tests."""
    running = RunningRobot(tmp_path_factory.mktemp("served"))
    yield running
    running.end()


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    """A tab; at the end its console must be without an error."""
    context = browser.new_context(viewport={"width": 1200, "height": 800})
    tab = context.new_page()
    tab.set_default_timeout(PATIENCE_MS)
    problems: list[str] = []
    tab.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
    tab.on("pageerror", lambda error: problems.append(str(error)))
    yield tab
    context.close()
    lost_connection = re.compile(r"WebSocket connection to 'ws://127\.0\.0\.1:\d+/socket' failed")
    assert [problem for problem in problems if not lost_connection.search(problem)] == []


def open_page(page: Any, robot: RunningRobot) -> None:
    """Open it, and wait until the robot can be driven."""
    page.goto(robot.url)
    mode_is(page, "Ready to drive")
    page.locator("h1").click()  # the tab has the focus now


def mode_is(page: Any, words: "str | re.Pattern[str]") -> None:
    """Wait for the word of the safety mode."""
    sync_api.expect(page.locator("#mode-word")).to_have_text(words, timeout=PATIENCE_MS)


def until(happens: Callable[[], bool], within_s: float = 8.0) -> bool:
    """Whether something happens in time."""
    end_s = time.monotonic() + within_s
    while time.monotonic() < end_s:
        if happens():
            return True
        time.sleep(0.05)
    return happens()


def speed_m_s(robot: SyncClient) -> float:
    """How fast the robot is, by its odometry."""
    odometry = robot.get_state().odometry
    assert odometry is not None
    return float(odometry.linear_m_s)


def test_it_loads_light_and_only_from_the_robot(page: Any, robot: RunningRobot) -> None:
    """Less than 300 kB, nothing from elsewhere; what the robot has not is not shown, and every control has a name."""
    answers: list[Any] = []
    page.on("response", lambda answer: answers.append(answer))
    open_page(page, robot)
    assert {answer.url.startswith(robot.url) for answer in answers} == {True}
    assert 5_000 < sum(len(answer.body()) for answer in answers) < MOST_BYTES
    assert page.locator("#robot").inner_text() == "chefbot"
    assert page.locator("#wheels-part").is_visible()
    assert not page.locator("#map-part").is_visible()
    assert not page.locator("#gesture-label").is_visible()
    sync_api.expect(page.locator("#wheels tr")).to_have_count(2)
    sync_api.expect(page.locator("#wheels tr").first.locator("td").nth(3)).to_have_text("200")  # kp
    tree = page.locator("body").aria_snapshot()
    assert not re.search(r"^\s*- (button|slider|combobox|checkbox|textbox)\s*(:|\[|$)", tree, re.MULTILINE), (
        tree
    )


def test_a_key_drives_until_it_is_let_go(page: Any, robot: RunningRobot) -> None:
    """Pressed, it drives and has control; let go, it brakes and gives control back."""
    open_page(page, robot)
    with robot.client() as client:
        page.keyboard.down("KeyS")
        assert until(lambda: speed_m_s(client) < -MOVES_M_S)
        sync_api.expect(page.locator("#drivers")).to_have_text("this page (teleop)")
        page.keyboard.up("KeyS")
        assert until(lambda: abs(speed_m_s(client)) < STANDS_M_S)
        sync_api.expect(page.locator("#drivers")).to_have_text("nobody")


@pytest.mark.parametrize("event", ["blur", "pagehide"])
def test_a_tab_without_the_focus_drives_nothing(page: Any, robot: RunningRobot, event: str) -> None:
    """The robot brakes though the key is still down; only a new press drives again."""
    open_page(page, robot)
    with robot.client() as client:
        page.keyboard.down("ArrowUp")
        assert until(lambda: speed_m_s(client) > MOVES_M_S)
        page.evaluate("name => { window.dispatchEvent(new Event(name)) }", event)
        assert until(lambda: abs(speed_m_s(client)) < STANDS_M_S)
        time.sleep(0.5)
        assert abs(speed_m_s(client)) < STANDS_M_S
        page.keyboard.up("ArrowUp")
        page.keyboard.down("ArrowUp")
        assert until(lambda: speed_m_s(client) > MOVES_M_S)


def test_the_emergency_stop_is_a_key_and_a_button(page: Any, robot: RunningRobot) -> None:
    """Esc while driving latches; arm releases; the button latches again, and a key that is still down moves nothing."""
    open_page(page, robot)
    with robot.client() as client:
        page.keyboard.down("KeyW")
        assert until(lambda: speed_m_s(client) > MOVES_M_S)
        page.keyboard.press("Escape")
        mode_is(page, "Emergency stop")
        assert client.get_state().safety.mode == "estopped"
        assert "press Arm" in page.locator("#mode-reason").inner_text()
        page.locator("#arm").click()
        mode_is(page, "Ready to drive")
        time.sleep(0.5)
        assert abs(speed_m_s(client)) < STANDS_M_S
        page.keyboard.up("KeyW")
        page.locator("#estop").click()
        mode_is(page, "Emergency stop")


def test_taking_over_from_another_driver(page: Any, robot: RunningRobot) -> None:
    """The page says who drives; after taking over its keys drive, and the other is refused."""
    open_page(page, robot)
    refused: list[str] = []
    ends = threading.Event()

    def other() -> None:
        with robot.client() as client:
            client.set_client_name("Ann")
            while not ends.wait(0.05):
                try:
                    client.drive(linear_m_s=0.0, angular_rad_s=0.3)
                except CallError as error:
                    refused.append(error.kind)

    driver = threading.Thread(target=other)
    driver.start()
    try:
        sync_api.expect(page.locator("#drivers")).to_contain_text("Ann")
        page.keyboard.down("KeyW")
        sync_api.expect(page.locator("#drive-told")).to_contain_text("Ann")
        page.keyboard.up("KeyW")
        assert refused == []
        page.locator("#take").click()
        page.keyboard.down("KeyW")
        sync_api.expect(page.locator("#drivers")).to_have_text("this page (teleop)")
        assert until(lambda: "lease_held" in refused)
    finally:
        ends.set()
        driver.join()


def test_the_page_comes_back_with_the_daemon(page: Any, robot: RunningRobot) -> None:
    """Killed and started again, it is connected by itself, and the key that was held all the time drives nothing."""
    open_page(page, robot)
    page.keyboard.down("KeyW")
    robot.end(signal.SIGKILL)
    mode_is(page, "Not connected")
    robot.start()
    mode_is(page, "Ready to drive")
    with robot.client() as client:
        time.sleep(0.5)
        assert abs(speed_m_s(client)) < STANDS_M_S
        page.keyboard.up("KeyW")
        page.keyboard.down("KeyW")
        assert until(lambda: speed_m_s(client) > MOVES_M_S)


def test_a_stalled_daemon_is_told_and_gets_no_old_commands(page: Any, robot: RunningRobot) -> None:
    """Frozen in mid-drive, key down: the page says so; then a fault stops the robot, and no old command moves it."""
    open_page(page, robot)
    page.keyboard.down("KeyW")
    with robot.client() as client:
        assert until(lambda: speed_m_s(client) > MOVES_M_S)
    robot.process.send_signal(signal.SIGSTOP)
    sync_api.expect(page.locator("#connection")).to_have_text("no answer", timeout=5000)
    mode_is(page, "The robot does not answer")
    robot.process.send_signal(signal.SIGCONT)
    sync_api.expect(page.locator("#connection")).to_have_text("connected")
    mode_is(page, "Stopped by a fault")
    with robot.client() as client:
        assert client.get_state().safety.fault == "loop_blocked"
        assert until(lambda: abs(speed_m_s(client)) < STANDS_M_S)
        time.sleep(0.5)
        assert abs(speed_m_s(client)) < STANDS_M_S


def test_a_frozen_tab_drives_nothing_when_it_goes_on(browser: Any, page: Any, robot: RunningRobot) -> None:
    """The browser's processes stand still for four seconds with a key down: the robot brakes, and stays where it is.

    The tab does not know what was let go meanwhile. It shows what is now, and a new press drives.
    """
    open_page(page, robot)
    told = browser.new_browser_cdp_session().send("SystemInfo.getProcessInfo")["processInfo"]
    tabs = [each["id"] for each in told if each["type"] == "renderer"]
    with robot.client() as client:
        page.keyboard.down("KeyW")
        assert until(lambda: speed_m_s(client) > MOVES_M_S)
        for tab in tabs:
            os.kill(tab, signal.SIGSTOP)
        try:
            assert until(lambda: abs(speed_m_s(client)) < STANDS_M_S)
            assert client.get_state().safety.mode == "armed"  # by the dead-man: no fault
            time.sleep(3.0)
            stands = client.get_state().odometry
        finally:
            for tab in tabs:
                os.kill(tab, signal.SIGCONT)
        mode_is(page, "Ready to drive")
        time.sleep(1.0)
        now = client.get_state().odometry
        assert stands is not None
        assert now is not None
        assert math.hypot(now.x_m - stands.x_m, now.y_m - stands.y_m) < 0.005
        sync_api.expect(page.locator("#pose")).to_contain_text(f"x {now.x_m:.2f} m")
        page.keyboard.up("KeyW")
        page.keyboard.down("KeyW")
        assert until(lambda: speed_m_s(client) > MOVES_M_S)


def slow_tablet(port: int) -> socket.socket:
    """A client of the page's WebSocket at full view that has asked for everything, and never reads."""
    tablet = socket.socket()
    tablet.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    tablet.connect(("127.0.0.1", port))
    tablet.sendall(
        f"GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
    )
    assert b"101" in tablet.recv(64)
    topics = ["odometry", "wheels", "imu", "ranges", "battery", "link", "safety", "stats"]
    asked = {
        "jsonrpc": "2.0",
        "id": 1,
        "method": "subscribe",
        "params": {"topics": topics, "max_rate_hz": 100.0},
    }
    line = json.dumps(asked).encode()
    tablet.sendall(b"\x81" + bytes([0x80 | 126]) + struct.pack(">H", len(line)) + bytes(4) + line)
    return tablet


def test_twenty_tablets_that_do_not_read_cost_the_robot_nothing(page: Any, robot: RunningRobot) -> None:
    """No control step is missed, the page drives and is shown what happens, and nothing piles up in the daemon."""
    open_page(page, robot)
    program = psutil.Process(robot.process.pid)
    with robot.client() as client:
        page.keyboard.down("KeyA")
        before, memory = client.get_stats(), program.memory_info().rss
        tablets = [slow_tablet(robot.page_port) for _ in range(20)]
        time.sleep(10.0)
        after = client.get_stats()
        sync_api.expect(page.locator("#drivers")).to_have_text("this page (teleop)")
        mode_is(page, "Ready to drive")
        assert int(page.locator("#latency").inner_text().removesuffix(" ms")) < 500
        page.keyboard.up("KeyA")
        grown = program.memory_info().rss - memory
    took_s = after.uptime_s - before.uptime_s
    assert after.control_steps - before.control_steps >= 20 * took_s - 4
    assert after.telemetry_dropped - before.telemetry_dropped > 20 * 10 * took_s
    assert grown < 20e6
    for tablet in tablets:
        tablet.close()


@pytest.fixture
def khan(tmp_path: Path) -> Iterator[RunningRobot]:
    """Four wheels and an infrared range finder, without a lidar."""
    running = RunningRobot(tmp_path, name="khan")
    yield running
    running.end()


def test_a_robot_with_four_wheels_and_no_lidar_shows_what_it_has(page: Any, khan: RunningRobot) -> None:
    """KHAN: a row for each wheel, its one range finder, no lidar, map, goal or place; and it drives."""
    open_page(page, khan)
    assert page.locator("#robot").inner_text() == "khan"
    sync_api.expect(page.locator("#wheels th")).to_have_text(
        ["front left", "front right", "rear left", "rear right"]
    )
    sync_api.expect(page.locator("#sensors li")).to_have_count(1)
    sync_api.expect(page.locator("#sensors li")).to_contain_text("front")
    for part in ("#map-part", "#goal-part", "#gesture-label", "#costs-label", "#legend-scan", "#legend-map"):
        sync_api.expect(page.locator(part)).to_be_hidden()
    with khan.client() as client:
        page.keyboard.down("KeyD")
        assert until(lambda: client.get_state().odometry.angular_rad_s < -0.2)
        page.keyboard.up("KeyD")
        assert until(lambda: abs(client.get_state().odometry.angular_rad_s) < 0.02)


@pytest.fixture
def board(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """A simulated board on a device of its own, and the device; its cable is pulled by a word."""
    device = tmp_path / "board"
    command = [sys.executable, "-c", "from chefbotd.start import chefbotd; chefbotd()"]
    with subprocess.Popen(
        [*command, "simulate", "--link", str(device)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    ) as program:
        assert until(device.exists, 20.0)
        yield program, device
        program.communicate("quit\n", 20.0)


def test_a_pulled_cable_is_told_and_drives_nothing_when_it_is_back(
    page: Any, board: tuple[subprocess.Popen[str], Path], tmp_path: Path
) -> None:
    """In mid-drive: the page tells the fault and the board; plugged in and armed, the old key drives nothing."""
    program, device = board

    def say(word: str) -> None:
        assert program.stdin is not None
        program.stdin.write(word + "\n")
        program.stdin.flush()

    robot = RunningRobot(tmp_path, device=device)
    try:
        open_page(page, robot)
        with robot.client() as client:
            page.keyboard.down("KeyW")
            assert until(lambda: speed_m_s(client) > MOVES_M_S)
            say("unplug")
            mode_is(page, "Stopped by a fault")
            sync_api.expect(page.locator("#mode-reason")).to_contain_text("the link was lost")
            sync_api.expect(page.locator("#link")).to_contain_text("not connected")
            say("plug")
            sync_api.expect(page.locator("#link")).to_have_text("connected")
            mode_is(page, "Stopped by a fault")
            page.locator("#arm").click()
            mode_is(page, "Ready to drive")
            time.sleep(0.5)
            assert abs(speed_m_s(client)) < STANDS_M_S
            page.keyboard.up("KeyW")
            page.keyboard.down("KeyW")
            assert until(lambda: speed_m_s(client) > MOVES_M_S)
    finally:
        robot.end()


def test_a_token_lets_in(page: Any, tmp_path: Path) -> None:
    """Nothing is shown before it; a wrong one is told; the right one is in no address, no log and no cookie."""
    token, wrong = "browser-token-0123456789", "another-token-0123456789"
    robot = RunningRobot(tmp_path, token=token)
    try:
        addresses: list[str] = []
        page.on("request", lambda request: addresses.append(request.url))
        page.goto(robot.url)
        for _ in range(3):  # the dialog comes back: without a token there is nothing else to do
            page.keyboard.press("Escape")
        page.locator("#token").fill(wrong)
        page.keyboard.press("Enter")
        sync_api.expect(page.locator("#login-told")).to_have_text("This token opens nothing here.")
        page.locator("#token").fill(token)
        page.keyboard.press("Enter")
        mode_is(page, "Ready to drive")
        page.reload()
        mode_is(page, "Ready to drive")
        assert page.context.cookies() == []
        assert not any("0123456789" in address for address in addresses)
        assert "0123456789" not in robot.log
    finally:
        robot.end()


def test_a_token_that_only_observes_offers_nothing_else(page: Any, tmp_path: Path) -> None:
    """No joystick, no gains to set, no arm; a key drives nothing and logs nothing; the emergency stop works."""
    robot = RunningRobot(tmp_path, token="browser-token-0123456789", role="observe")
    try:
        page.goto(robot.url)
        page.locator("#token").fill("browser-token-0123456789")
        page.keyboard.press("Enter")
        mode_is(page, "Ready to drive")
        sync_api.expect(page.locator("#role")).to_have_text("watch and stop")
        for part in ("#driving", "#gains", "#arm"):
            sync_api.expect(page.locator(part)).to_be_hidden()
        page.keyboard.down("KeyW")
        time.sleep(0.5)
        page.keyboard.up("KeyW")
        sync_api.expect(page.locator("#alert")).to_be_empty()
        assert "role_required" not in robot.log
        page.locator("#estop").click()
        mode_is(page, "Emergency stop")
        sync_api.expect(page.locator("#mode-reason")).to_contain_text("Somebody who may drive")
    finally:
        robot.end()


def test_a_phone_drives_by_the_joystick(page: Any, robot: RunningRobot) -> None:
    """At 390 pixels nothing is cut off, the emergency stop is in sight, and the joystick drives until it is let go."""
    page.set_viewport_size({"width": 390, "height": 844})
    open_page(page, robot)
    assert page.evaluate("() => document.documentElement.scrollWidth") == 390
    edges = "() => [...document.querySelectorAll('table')].map((each) => each.getBoundingClientRect().right)"
    page.wait_for_function("() => document.querySelectorAll('td').length > 0")
    assert all(edge <= 390 for edge in page.evaluate(edges)), page.evaluate(edges)
    button = page.locator("#estop").bounding_box()
    assert button["y"] + button["height"] <= 844
    page.evaluate("() => document.getElementById('driving').scrollIntoView()")
    pad = page.locator("#joystick").bounding_box()
    middle = (pad["x"] + pad["width"] / 2, pad["y"] + pad["height"] / 2)
    with robot.client() as client:
        page.mouse.move(*middle)
        page.mouse.down()
        page.mouse.move(middle[0] - 10, middle[1] - 60)
        assert until(lambda: speed_m_s(client) > MOVES_M_S)
        page.mouse.up()
        assert until(lambda: abs(speed_m_s(client)) < STANDS_M_S)


GAMEPAD = """() => {
  window.pad = { connected: true, mapping: "standard", axes: [0, 0, 0, 0],
    buttons: Array.from({ length: 17 }, () => ({ pressed: false })) };
  navigator.getGamepads = () => [window.pad];
}"""


def test_a_gamepad_drives_while_its_enable_button_is_held(page: Any, robot: RunningRobot) -> None:
    """The stick alone moves nothing, LB and the stick drive backward, LB let go brakes, B is the emergency stop."""
    open_page(page, robot)
    page.evaluate(GAMEPAD)
    with robot.client() as client:
        page.evaluate("() => { window.pad.axes = [0.05, 0.9, 0, 0] }")
        time.sleep(0.5)
        assert abs(speed_m_s(client)) < STANDS_M_S
        page.evaluate("() => { window.pad.buttons[4].pressed = true }")
        assert until(lambda: speed_m_s(client) < -MOVES_M_S)
        page.evaluate("() => { window.pad.buttons[4].pressed = false }")
        assert until(lambda: abs(speed_m_s(client)) < STANDS_M_S)
        page.evaluate("() => { window.pad.buttons[1].pressed = true }")
        mode_is(page, "Emergency stop")


class FakeDaemon:
    """The other end of the page's WebSocket: a robot that finds its way, and remembers what it was asked."""

    METHODS = (
        *("drive", "stop", "estop", "arm", "navigate_to", "set_pose", "cancel_navigation"),
        *("list_places", "save_place", "delete_place", "list_maps", "start_mapping", "localize"),
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
        self._page = page
        page.route_web_socket(re.compile("/socket$"), self._connected)

    def _connected(self, socket: Any) -> None:
        self._socket = socket
        socket.on_message(self._take)
        capabilities = [f"method.{name}" for name in self.METHODS] + [f"topic.{name}" for name in self.TOPICS]
        self._send("hello", {"robot": "fake", "auth": "none", "capabilities": capabilities})

    def _take(self, line: str) -> None:
        request = json.loads(line)
        self.asked.append((request["method"], request.get("params", {})))
        result = self.RESULTS.get(request["method"], {})
        if "id" in request:
            self._socket.send(json.dumps({"jsonrpc": "2.0", "id": request["id"], "result": result}))

    def _send(self, method: str, params: dict[str, Any]) -> None:
        self._socket.send(json.dumps({"jsonrpc": "2.0", "method": method, "params": params}))

    def say(self, topic: str, **data: Any) -> None:
        """Send an event, of which there are none before the page has asked for them."""
        assert until(lambda: self.was_asked("subscribe"))
        self._send("event", {"topic": topic, "seq": 1, "stamp_s": 1.0, "age_s": 0.0, "data": data})

    def was_asked(self, method: str) -> bool:
        """Whether a request of a method has come; playwright hands messages over only while it is called."""
        self._page.wait_for_timeout(50)
        return any(name == method for name, _ in self.asked)

    def last(self, method: str) -> dict[str, Any]:
        """The parameters of the latest request of a method."""
        self._page.wait_for_timeout(50)
        return [params for name, params in self.asked if name == method][-1]


def pixel(page: Any, x: float, y: float) -> list[int]:
    """The colour of the view at a place of the window."""
    script = """([x, y]) => { const box = view.getBoundingClientRect();
      return [...view.getContext("2d").getImageData(x - box.x, y - box.y, 1, 1).data].slice(0, 3); }"""
    colour: list[int] = page.evaluate(script, [x, y])
    return colour


def test_a_click_sends_the_robot_there_and_a_drag_gives_the_heading(page: Any, served: RunningRobot) -> None:
    """At 90 pixels a metre around the robot at (2, -1): 45 right and 90 down are (2.5, -2); a drag up is 90 degrees."""
    daemon = FakeDaemon(page)
    page.goto(served.url)
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    page.emulate_media(color_scheme="light")
    sync_api.expect(page.locator("#goal")).to_have_text("No goal. Click in the view to send the robot there.")
    daemon.say("map_pose", x_m=2.0, y_m=-1.0, heading_rad=0.3, state="localized")
    daemon.say("navigation", state="driving", goal=1, reason="", distance_m=3.21, time_s=9.0)
    sync_api.expect(page.locator("#goal")).to_have_text("driving, 3.2 m left")
    box = page.locator("#view").bounding_box()
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert until(lambda: pixel(page, *middle) == [0x0B, 0x57, 0xD0])  # the robot is drawn
    x, y = middle[0] + 45, middle[1] + 90
    page.mouse.click(x, y)
    assert until(lambda: daemon.was_asked("navigate_to"))
    assert daemon.last("navigate_to") == {
        "x_m": pytest.approx(2.5, abs=0.02),
        "y_m": pytest.approx(-2.0, abs=0.02),
    }
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 60)
    page.mouse.up()
    assert until(lambda: "heading_rad" in daemon.last("navigate_to"))
    assert daemon.last("navigate_to")["heading_rad"] == pytest.approx(1.5708, abs=0.02)
    page.locator("#gesture").select_option("set_pose")
    page.mouse.click(x, y)
    assert until(lambda: daemon.was_asked("set_pose"))
    page.locator("#goal-cancel").click()
    assert until(lambda: daemon.was_asked("cancel_navigation"))


def test_the_map_is_drawn_where_it_is(page: Any, served: RunningRobot) -> None:
    """Of 3 by 2 cells of 0.5 m from (1, 2) the upper right one is a wall, drawn up and to the right; then it goes."""
    daemon = FakeDaemon(page)
    page.goto(served.url)
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    page.emulate_media(color_scheme="light")
    daemon.say("odometry", x_m=9.0, y_m=9.0, heading_rad=0.0, linear_m_s=0.0, angular_rad_s=0.0)
    daemon.say("map_pose", x_m=1.0, y_m=2.0, heading_rad=-2.0, state="localized")
    grid = {"resolution_m": 0.5, "x_m": 1.0, "y_m": 2.0, "heading_rad": 0.0, "columns": 3, "rows": 2}

    def cells(*values: int) -> str:
        return base64.b64encode(zlib.compress(struct.pack(f"{len(values)}b", *values))).decode()

    whole = {"column": 0, "row": 0, "part_columns": 3, "part_rows": 2, "whole": True}
    daemon.say("map", revision=7, **grid, **whole, encoding="zlib", cells=cells(0, 0, -1, -1, 0, 100))
    box = page.locator("#view").bounding_box()
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    wall, free = (
        (middle[0] + 1.25 * 90, middle[1] - 0.75 * 90),
        (middle[0] + 0.75 * 90, middle[1] - 0.75 * 90),
    )
    assert until(lambda: pixel(page, *wall) == [0x20, 0x26, 0x2D])
    assert pixel(page, *free) == [255, 255, 255]
    part = {"column": 2, "row": 1, "part_columns": 1, "part_rows": 1, "whole": False}
    daemon.say("map", revision=8, **grid, **part, encoding="zlib", cells=cells(0))
    assert until(lambda: pixel(page, *wall) == [255, 255, 255])


def test_costs_are_asked_for_while_they_are_shown(page: Any, served: RunningRobot) -> None:
    """One cell of 1 m that is blocked, under the robot at its middle, is tinted until the box is unticked."""
    daemon = FakeDaemon(page)
    page.goto(served.url)
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    page.emulate_media(color_scheme="light")
    daemon.say("map_pose", x_m=0.25, y_m=0.75, heading_rad=0.0, state="localized")
    page.get_by_label("Costs and obstacles").check()
    asked = {"topics": ["costmap"], "policy": "ordered"}
    assert until(lambda: daemon.was_asked("subscribe") and daemon.last("subscribe") == asked)
    cell = base64.b64encode(zlib.compress(struct.pack("b", 100))).decode()
    size = {"columns": 1, "rows": 1, "part_columns": 1, "part_rows": 1, "column": 0, "row": 0}
    place = {"resolution_m": 1.0, "x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0, "revision": 1, "map": "flat"}
    daemon.say("costmap", **place, **size, encoding="zlib", cells=cell)
    box = page.locator("#view").bounding_box()
    beside = (box["x"] + box["width"] / 2 + 45, box["y"] + box["height"] / 2 + 45)  # (0.75, 0.25)
    plain = [0xF6, 0xF7, 0xF9]
    assert until(lambda: pixel(page, *beside) != plain)
    page.get_by_label("Costs and obstacles").uncheck()
    assert until(lambda: pixel(page, *beside) == plain)
    assert daemon.last("unsubscribe") == {"topics": ["costmap"]}


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1200, 390])
def test_it_has_no_barrier_that_axe_can_find(
    page: Any, served: RunningRobot, scheme: str, width: int
) -> None:
    """Names, roles, contrast and order, with every part shown, on a screen and on a phone, by day and by night."""
    page.set_viewport_size({"width": width, "height": 800})
    page.emulate_media(color_scheme=scheme)
    daemon = FakeDaemon(page)
    page.goto(served.url)
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    daemon.say("navigation", state="driving", goal=1, reason="", distance_m=3.21, time_s=9.0)
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    daemon.say("safety", mode="estopped", reason="by Ann", armed=False, source=None, control={})
    sync_api.expect(page.locator("#place-form")).to_be_visible()
    found = axe.Axe().run(page).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"]) for each in found] == []


def test_a_place_is_gone_to_saved_and_deleted_by_its_name(page: Any, served: RunningRobot) -> None:
    """The list offers the places of the map in use; nothing is asked without a name, or deleted without a yes."""
    daemon = FakeDaemon(page)
    page.goto(served.url)
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    sync_api.expect(page.locator("#place-form")).to_be_hidden()  # no map is in use
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    sync_api.expect(page.locator("#places option")).to_have_count(2)
    page.get_by_role("button", name="Go there").click()
    page.locator("#place").fill("table 3")
    page.get_by_role("button", name="Go there").click()
    assert until(lambda: daemon.was_asked("navigate_to"))
    assert daemon.last("navigate_to") == {"place": "table 3"}
    page.get_by_role("button", name="Save where it stands").click()
    assert until(lambda: daemon.was_asked("save_place"))
    assert daemon.last("save_place") == {"name": "table 3"}
    delete = page.get_by_role("button", name="Delete", exact=True)
    delete.click()
    question = page.get_by_role("alertdialog", name="Delete the place table 3 from the map flat?")
    sync_api.expect(question).to_be_visible()
    sync_api.expect(page.get_by_role("button", name="Keep it")).to_be_focused()
    assert axe.Axe().run(page).response["violations"] == []
    page.keyboard.press("Escape")  # is the emergency stop, here too
    assert until(lambda: daemon.was_asked("estop"))
    page.keyboard.press("Enter")
    sync_api.expect(question).to_be_hidden()
    sync_api.expect(delete).to_be_focused()
    assert not daemon.was_asked("delete_place")
    delete.click()
    page.locator("#place").fill("kitchen")  # the question was about another one
    page.get_by_role("button", name="Delete it").click()
    assert until(lambda: daemon.was_asked("delete_place"))
    assert daemon.last("delete_place") == {"name": "table 3"}
    sync_api.expect(question).to_be_hidden()


def test_poses_are_typed_where_nobody_can_click(page: Any, served: RunningRobot) -> None:
    """By the keyboard alone: to x, y and a heading in degrees; and the robot stands at a place, or at coordinates."""
    daemon = FakeDaemon(page)
    page.goto(served.url)
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    sync_api.expect(page.locator("#places option")).to_have_count(2)
    page.locator("#place").fill("1.25 -3 -90")
    page.keyboard.press("Enter")
    assert until(lambda: daemon.was_asked("navigate_to"))
    assert daemon.last("navigate_to") == {"x_m": 1.25, "y_m": -3, "heading_rad": pytest.approx(-1.570796)}
    stands_here = page.get_by_role("button", name="It stands here")
    page.locator("#place").fill("kitchen")
    stands_here.press("Enter")
    assert until(lambda: daemon.was_asked("set_pose"))
    assert daemon.last("set_pose") == {"x_m": 1.5, "y_m": -0.25, "heading_rad": 2.0}
    page.locator("#place").fill("0.5, 2")
    stands_here.press("Enter")
    assert daemon.last("set_pose") == {"x_m": 0.5, "y_m": 2}
    page.locator("#place").fill("cellar")
    stands_here.press("Enter")
    sync_api.expect(page.locator("#alert")).to_have_text("There is no place cellar on this map.")


def test_without_a_map_the_page_says_what_to_do_first(page: Any, served: RunningRobot) -> None:
    """No map in use: not that a click sends the robot somewhere, and nothing that needs a map; with one, both."""
    daemon = FakeDaemon(page)
    page.goto(served.url)
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    daemon.say("localization", state="unknown", map=None, fit=0.0, reason="")
    sync_api.expect(page.locator("#goal")).to_contain_text("No map is in use")
    sync_api.expect(page.locator("#map-told")).to_contain_text("Start one and drive")
    sync_api.expect(page.locator("#map-start")).to_be_visible()
    sync_api.expect(page.locator("#map-localize")).to_be_hidden()
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    sync_api.expect(page.locator("#goal")).to_contain_text("Click in the view")
    for name in ("#map-localize", "#map-localize-turn"):
        sync_api.expect(page.locator(name)).to_be_visible()
    page.locator("#map-localize-turn").click()
    sync_api.expect(page.locator("#alert")).to_contain_text("localized: it knows where it is")
    assert ("localize", {"turn": True}) in daemon.asked


@pytest.mark.parametrize("event", ["contextmenu", "dragstart", "keydown Control"])
def test_what_may_hide_the_end_of_a_key_ends_the_driving(page: Any, served: RunningRobot, event: str) -> None:
    """With a menu open, in a drag and after a shortcut, a browser may not tell that a key is let go."""
    daemon = FakeDaemon(page)
    page.goto(served.url)
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    page.locator("h1").click()

    def pressed() -> bool:
        page.keyboard.up("KeyS")
        page.keyboard.down("KeyS")
        return daemon.was_asked("drive") and daemon.last("drive") == {"linear_m_s": -0.2, "angular_rad_s": 0}

    assert until(pressed)
    before = len(daemon.asked)
    if event.startswith("keydown"):
        page.keyboard.down(event.partition(" ")[2])
    else:
        page.evaluate("name => { document.body.dispatchEvent(new Event(name, { bubbles: true })) }", event)
    page.wait_for_timeout(1500)
    asked = [(name, params) for name, params in daemon.asked[before:] if name in ("drive", "release_control")]
    assert asked[-2:] == [("drive", {"linear_m_s": 0, "angular_rad_s": 0}), ("release_control", {})]


def test_a_screen_reader_is_told_faults_at_once_and_goals_without_the_metres(
    page: Any, served: RunningRobot
) -> None:
    """A fault interrupts; what is left to drive changes all the time and is not read out, how the goal ends is."""
    daemon = FakeDaemon(page)
    page.goto(served.url)
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    ready = {"mode": "armed", "reason": "armed", "armed": True, "source": None, "control": {}}
    daemon.say("safety", **ready)
    told = page.locator("#mode-told")
    sync_api.expect(told).to_have_text("Ready to drive")
    assert told.get_attribute("aria-live") == "polite"
    sync_api.expect(page.locator("#arm")).to_be_disabled()
    stalled = {"mode": "disarmed", "reason": "left_wheel does not turn: check its plug", "armed": False}
    daemon.say("safety", **{**ready, **stalled})
    sync_api.expect(told).to_contain_text("check its plug. When it is safe, press Arm.")
    assert told.get_attribute("aria-live") == "assertive"
    daemon.say("navigation", state="driving", goal=1, reason="", distance_m=3.21, time_s=9.0)
    sync_api.expect(page.locator("#goal-told")).to_have_text("driving")
    daemon.say("navigation", state="blocked", goal=1, reason="a chair", distance_m=1.0, time_s=9.0)
    sync_api.expect(page.locator("#goal-told")).to_have_text("blocked: a chair")
    assert page.locator("#goal").get_attribute("role") is None


def test_a_gain_is_set_for_a_wheel_and_taken_back(page: Any, robot: RunningRobot) -> None:
    """The daemon has the new gain, the table shows it, and undo brings the packaged 200 back."""
    open_page(page, robot)
    shown = page.locator("tr[data-wheel=left_wheel] td").nth(3)
    sync_api.expect(shown).to_have_text("200")
    page.locator("#gain-wheel").select_option("left_wheel")
    page.locator("#gain-value").fill("170.5")
    page.get_by_role("button", name="Set").click()
    sync_api.expect(shown).to_have_text("170.5")
    with robot.client() as client:
        gains = client.get_pid()
    assert (gains["left_wheel"].kp, gains["right_wheel"].kp) == (170.5, 200.0)
    page.get_by_role("button", name="Undo").click()
    sync_api.expect(shown).to_have_text("200")


def test_clients_are_counted(page: Any, robot: RunningRobot) -> None:
    """The page is one, and a program beside it another."""
    open_page(page, robot)
    sync_api.expect(page.locator("#clients")).to_have_text("1")
    with robot.client():
        sync_api.expect(page.locator("#clients")).to_have_text("2")
