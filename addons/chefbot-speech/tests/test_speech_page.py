"""The page in chromium, whose microphone is a file: what a press stops, and what becomes of what is said."""

import asyncio
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import wave
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from chefbotd.client import SyncClient
from chefbotd.components.maps.storage.contents import save
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.transport.ports import reserve_port
from tests.chefbotd.components.maps.storage.test_store import grid

CHROMIUM = shutil.which("chromium")
PATIENCE_S = 100.0
DAEMON = [sys.executable, "-c", "from chefbotd.start import chefbotd; chefbotd()", "run", "--sim"]
SPEECH = [sys.executable, "-m", "chefbot_speech.main"]


def required(is_there: bool, what: str) -> None:
    """Without it there is no test; with ADDONS_TESTS=required that is a failure."""
    if not is_there:
        pytest.fail(what) if os.environ.get("ADDONS_TESTS") == "required" else pytest.skip(what)


def until(happens: Any, within_s: float = PATIENCE_S) -> None:
    """Wait for something."""
    end_s = time.monotonic() + within_s
    while not happens():
        assert time.monotonic() < end_s
        time.sleep(0.02)


class Restaurant:
    """A simulated robot with a map and three tables, and ``chefbot-speech`` before it."""

    def __init__(self, folder: Path) -> None:
        self.api_port, self.page_port = reserve_port(), reserve_port()
        save(MapStore(folder / "maps"), "flat", grid(1))
        text = f'extends = "chefbot_lidar"\n[api]\nport = {self.api_port}\n'
        (folder / "robot.toml").write_text(text)
        environment = {**os.environ, "CHEFBOTD_MAPS__FOLDER": str(folder / "maps")}
        self._log = (folder / "log").open("wb")
        config = ["--config", str(folder / "robot.toml")]
        self._programs = [self._start([*DAEMON, *config], environment)]
        with self.client() as robot:
            robot.wait_until_armed(PATIENCE_S)
            robot.load_map("flat")
            for number in (1, 2, 3):
                robot.save_place(f"table {number}", float(number), 1.0, 0.0, kind="table")
        where = ["--connect", f"127.0.0.1:{self.api_port}", "--port", str(self.page_port)]
        self._programs.append(self._start([*SPEECH, *where], environment))
        with self.client() as robot:
            until(lambda: [agent.name for agent in self.agents(robot)] == ["speech"])

    def _start(self, words: list[str], environment: dict[str, str]) -> "subprocess.Popen[bytes]":
        return subprocess.Popen(words, stdout=self._log, stderr=self._log, env=environment)

    @staticmethod
    def agents(robot: SyncClient) -> Any:
        """The agents that the daemon knows."""
        known = robot.get_state().topics.get("agents")
        return () if known is None else known.data.agents

    def client(self) -> SyncClient:
        """A client of the daemon, which has a while to begin listening."""
        ends_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < ends_s:
            try:
                return SyncClient.connect("127.0.0.1", self.api_port)
            except OSError:
                time.sleep(0.1)
        raise TimeoutError

    def end(self) -> None:
        """End both."""
        for program in reversed(self._programs):
            program.send_signal(signal.SIGINT)
            try:
                program.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                program.kill()
                program.wait()
        self._log.close()


@pytest.fixture(scope="module")
def restaurant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Restaurant]:
    """One for all."""
    required(CHROMIUM is not None, "the page needs a browser: make addons-tools")
    required(find_spec("playwright") is not None, "the page needs playwright: the extra 'test'")
    running = Restaurant(tmp_path_factory.mktemp("restaurant"))
    yield running
    running.end()


@pytest.fixture(scope="module")
def spoken(espeak: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the microphone hears, again and again: a second of silence, "go to table three", two seconds of silence."""
    path = tmp_path_factory.mktemp("voice") / "said.wav"
    subprocess.run([espeak, "-v", "en-us", "-w", str(path), "--", "go to table three"], check=True)
    with wave.open(str(path)) as sound:
        rate_hz, said = sound.getframerate(), sound.readframes(sound.getnframes())
    with wave.open(str(path), "wb") as sound:
        sound.setparams((1, 2, rate_hz, 0, "NONE", ""))
        sound.writeframes(bytes(2 * rate_hz) + said + bytes(4 * rate_hz))
    return path


@pytest.fixture
def page(restaurant: Restaurant, spoken: Path) -> Iterator[Any]:
    """The page with that microphone, which it may use; its console stays without an error."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=[
                *("--no-sandbox", "--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream"),
                f"--use-file-for-fake-audio-capture={spoken}",
            ],
        )
        context = browser.new_context(permissions=["microphone"])
        tab = context.new_page()
        tab.set_default_timeout(1000 * PATIENCE_S)
        problems: list[str] = []
        tab.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
        tab.on("pageerror", lambda error: problems.append(str(error)))
        tab.goto(f"http://127.0.0.1:{restaurant.page_port}/")
        tab.locator("#talk").wait_for()
        yield tab
        browser.close()
        assert problems == []


def held(page: Any, seconds: float) -> None:
    """The button is held for so long, which is how long somebody speaks."""
    page.locator("#talk").hover()
    page.mouse.down()
    page.wait_for_timeout(1000 * seconds)
    page.mouse.up()


def test_what_is_said_into_the_microphone_is_proposed_and_a_yes_goes_there(
    page: Any, restaurant: Restaurant
) -> None:
    """The echo is on the page and on the robot's; a touched yes is a goal at that table."""
    assert page.locator("#places li").all_text_contents()[:3] == [
        f"Go to table {number}" for number in (1, 2, 3)
    ]
    held(page, 0.2)  # the microphone is opened, and nothing is said
    for _ in range(5):  # where the phrase began before the press, it is said again
        held(page, 4.0)
        page.locator("body[data-phase=ready]").wait_for()
        if page.locator("#yes").is_visible():
            break
    assert page.locator("#text").text_content() == "Go to table 3? Say or touch yes."
    with restaurant.client() as robot:
        until(lambda: restaurant.agents(robot)[0].text == "Go to table 3? Say or touch yes.")
        page.locator("#yes").click()
        until(lambda: restaurant.agents(robot)[0].text not in ("Go to table 3? Say or touch yes.", ""))
        log = [line.text for line in robot.get_state().topics["log"].data.lines]
        assert "I am going to table 3." in log


def test_pressing_stops_a_robot_that_drives(page: Any, restaurant: Restaurant) -> None:
    """Whoever drives it is refused until it lets go."""

    async def drive() -> str:
        from chefbotd.client import CallError, Client

        async with Client.connect("127.0.0.1", restaurant.api_port, name="a joystick") as robot:
            while True:
                try:
                    await robot.drive(0.1, 0.0)
                    driving.set()
                except CallError as refused:
                    if refused.kind not in ("overtaken", "too_old"):  # on its way: it is to be given again
                        return refused.kind
                await asyncio.sleep(0.05)

    driving, ends = threading.Event(), []
    thread = threading.Thread(target=lambda: ends.append(asyncio.run(drive())))
    thread.start()
    assert driving.wait(PATIENCE_S)
    held(page, 0.1)
    thread.join(PATIENCE_S)
    assert ends == ["stopped"]


def test_a_page_without_https_says_why_there_is_no_microphone(page: Any) -> None:
    """And tells of the press all the same."""
    page.evaluate("Object.defineProperty(navigator, 'mediaDevices', { value: undefined })")
    held(page, 0.1)
    page.get_by_text("no microphone to a page without https").wait_for()


def test_a_microphone_that_is_unplugged_is_said_and_asked_for_again(page: Any) -> None:
    """Not silence for ever: what was broken off is not understood, and the next press opens one again."""
    page.evaluate(
        """() => {
          const open = navigator.mediaDevices.getUserMedia.bind(navigator.mediaDevices);
          window.opened = [];
          navigator.mediaDevices.getUserMedia = async (asked) => {
            const stream = await open(asked);
            window.opened.push(stream.getAudioTracks()[0]);
            return stream;
          };
        }"""
    )
    held(page, 0.2)
    page.locator("body[data-phase=ready]").wait_for()
    page.locator("#talk").hover()
    page.mouse.down()
    page.locator("body[data-phase=listening]").wait_for()
    page.evaluate("window.opened.at(-1).dispatchEvent(new Event('ended'))")
    page.get_by_text("The microphone is gone").wait_for()
    page.locator("body[data-phase=ready]").wait_for()
    assert page.locator("#talk").get_attribute("aria-pressed") == "false"
    page.mouse.up()
    held(page, 0.2)
    page.wait_for_function(
        "window.opened.length === 2 && document.querySelector('#microphone').textContent === ''"
    )
