"""The teleop screen, headless: what is on it, and what its keys ask of the daemon."""

import asyncio
import sys
from collections.abc import Awaitable, Callable
from itertools import groupby

import pytest
from rich.console import Console
from textual import events
from textual.pilot import Pilot
from textual.widgets import Static

from chefbotd.cli.common.exits import Exit
from chefbotd.cli.common.state_text import Fact, Style
from chefbotd.cli.drive.teleop import Teleop
from chefbotd.client import Client, ConnectionLost
from tests.budget import sample
from tests.chefbotd.cli.fake_daemon import FakeDaemon
from tests.chefbotd.conftest import Control
from tests.waiting import PATIENCE_S


def on_screen(
    daemon: FakeDaemon,
    script: Callable[[Teleop, Pilot[None]], Awaitable[None]],
    *,
    reconnects: bool = False,
) -> Teleop:
    """Run the screen at 80x24 on the real clock (Textual has its own) while ``script`` plays the user."""

    async def main() -> Teleop:
        async with Client.connect("127.0.0.1", daemon.port, reconnect=reconnects) as robot:
            screen = Teleop(robot, "robot:7333", reconnects=reconnects)
            async with screen.run_test(size=(80, 24)) as user:
                await script(screen, user)
            return screen

    return asyncio.run(daemon.beside(main()))


def test_it_shows_what_the_robot_does(daemon: FakeDaemon) -> None:
    """Mode, link, pose, speeds, battery, ranges, latency and the keys are all there at 80x24."""
    told: list[str] = []

    async def script(screen: Teleop, user: Pilot[None]) -> None:
        await seen(screen, user, "latency", "ms round trip")
        told.append(text(screen))

    on_screen(daemon, script)
    for words in ("armed", "up on", "x +0.000 m", "asked", "12.34 V", "front 1.50 m", "0.20 m/s  0.80 rad/s"):
        assert words in told[0]


def test_keys_drive_and_stop(daemon: FakeDaemon) -> None:
    """A motion key drives, the space bar stops, and leaving, with nothing held, says no more."""

    async def script(screen: Teleop, user: Pilot[None]) -> None:
        await user.press("i")
        await called(daemon, user, "drive")
        await user.press("space")
        await called(daemon, user, "stop")
        await user.press("ctrl+q")

    screen = on_screen(daemon, script)
    asked = [name for _, name, _ in daemon.calls if name in ("drive", "stop")]
    assert [name for name, _ in groupby(asked)] == ["drive", "stop"]
    assert asked.count("stop") == 1
    assert screen.failure is None


@pytest.mark.parametrize(
    ("key", "method"),
    sample([("exclamation_mark", "estop"), ("backspace", "estop"), ("escape", "estop"), ("f2", "arm")]),
)
def test_keys_lock_and_arm(daemon: FakeDaemon, key: str, method: str) -> None:
    """``!``, Esc and backspace are the emergency stop, F2 arms; neither moves the robot."""

    async def script(screen: Teleop, user: Pilot[None]) -> None:
        await user.press(key)
        await called(daemon, user, method)

    on_screen(daemon, script)
    assert "drive" not in daemon.methods()


def test_f2_clears_what_the_screen_shows(daemon: FakeDaemon) -> None:
    """It names the last latch that it has been told of, and so none that comes just before the key."""
    daemon.latch = 0x1F3A07C2 * 2**20 + 3

    async def script(screen: Teleop, user: Pilot[None]) -> None:
        await seen(screen, user, "armed")
        await user.press("f2")
        await called(daemon, user, "arm")

    on_screen(daemon, script)
    assert [given for _, name, given in daemon.calls if name == "arm"] == [{"latch": daemon.latch}]


def test_refusals_are_shown(daemon: FakeDaemon) -> None:
    """What the robot refuses is told on the message line."""
    daemon.refuse.update(drive="link_down", arm="link_down")
    told: list[str] = []

    async def script(screen: Teleop, user: Pilot[None]) -> None:
        for key in ("i", "f2"):
            await user.press(key)
            await called(daemon, user, "drive" if key == "i" else "arm")
            await user.pause(0.05)
            told.append(str(screen.query_one("#message", Static).content))

    on_screen(daemon, script)
    assert told == ["link_down: it will not"] * 2


def test_a_lost_focus_stops(daemon: FakeDaemon) -> None:
    """When the terminal loses the focus the motion ends, whatever key is held."""

    async def script(screen: Teleop, user: Pilot[None]) -> None:
        await user.press("i")
        await called(daemon, user, "drive")
        screen.post_message(events.AppBlur())
        await called(daemon, user, "release_control")

    on_screen(daemon, script)


@pytest.mark.parametrize(("key", "method"), [("i", "drive"), ("f2", "arm")])
def test_a_lost_connection_ends_it(daemon: FakeDaemon, key: str, method: str) -> None:
    """When the daemon goes away the screen closes and says why."""
    daemon.hang_up_on = method

    async def script(screen: Teleop, user: Pilot[None]) -> None:
        await user.press(key)
        await called(daemon, user, method)
        await user.pause(0.05)

    assert isinstance(on_screen(daemon, script).failure, ConnectionLost)


def test_a_lost_connection_is_opened_again(daemon: FakeDaemon) -> None:
    """Lost in mid-drive: no key counts as held when it is back, and then a new key drives."""

    def subscriptions() -> int:
        return sum(name == "subscribe" for _, name, _ in daemon.calls)

    async def script(screen: Teleop, user: Pilot[None]) -> None:
        await seen(screen, user, "ms round trip")
        daemon.hang_up_on = "drive"
        await user.press("i")
        await called(daemon, user, "drive")
        daemon.hang_up_on = None
        await _until(user, lambda: subscriptions() > 1)
        lost_at = len(daemon.calls)
        await user.pause(0.2)
        assert "drive" not in [name for _, name, _ in daemon.calls[lost_at:]]
        await user.press("j")
        await _until(user, lambda: "drive" in [name for _, name, _ in daemon.calls[lost_at:]])

    screen = on_screen(daemon, script, reconnects=True)
    assert screen.failure is None


def test_an_emergency_stop_without_a_connection_is_not_said_to_be_done(daemon: FakeDaemon) -> None:
    """The message says that the daemon may not have got it."""
    told: list[str] = []

    async def script(screen: Teleop, user: Pilot[None]) -> None:
        await seen(screen, user, "ms round trip")
        daemon.hang_up_on = "estop"
        await user.press("exclamation_mark")
        await called(daemon, user, "estop")
        await _until(user, lambda: str(screen.query_one("#message", Static).content) != "")
        told.append(str(screen.query_one("#message", Static).content))

    on_screen(daemon, script, reconnects=True)
    assert told == ["The connection is lost: the daemon may not have got this."]


def test_without_a_connection_nothing_old_looks_like_news(
    daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While the connection is lost that is told first, and all that was told before is faint."""
    shown: list[list[Fact]] = []

    async def script(screen: Teleop, user: Pilot[None]) -> None:
        await seen(screen, user, "ms round trip", "armed")
        with monkeypatch.context() as lost:
            lost.setattr(Client, "connected", property(lambda _robot: False))
            shown.append(screen._facts())

    on_screen(daemon, script, reconnects=True)
    (first, *rest) = shown[0]
    assert (first.text, first.style) == ("connection lost, trying again", Style.ALARM)
    assert {fact.style for fact in rest if fact.label in ("mode", "link", "pose", "battery")} == {Style.FAINT}


def test_a_key_takes_control(daemon: FakeDaemon) -> None:
    """``t`` asks for the default source, and does not drive."""
    told: list[str] = []

    async def script(screen: Teleop, user: Pilot[None]) -> None:
        await user.press("t")
        await called(daemon, user, "take_control")
        await user.pause(0.05)
        told.append(str(screen.query_one("#message", Static).content))

    on_screen(daemon, script)
    assert told == ["You have control; the previous driver's motion ends."]
    assert "drive" not in daemon.methods()


def test_without_textual(control: Control, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the extra the command says what to install, and exits with 7."""
    monkeypatch.setitem(sys.modules, "textual", None)
    monkeypatch.delitem(sys.modules, "chefbotd.cli.drive.teleop", raising=False)
    result = control("teleop")
    assert result.exit_code == Exit.NOT_INSTALLED
    assert "pip install 'chefbotd[teleop]'" in result.stderr


async def called(daemon: FakeDaemon, user: Pilot[None], method: str) -> None:
    """Wait, at most a minute, until the daemon was asked for ``method``."""
    await _until(user, lambda: method in daemon.methods())


async def seen(screen: Teleop, user: Pilot[None], *words: str) -> None:
    """Wait, at most a minute, until the words are on the screen."""
    await _until(user, lambda: all(word in text(screen) for word in words))


async def _until(user: Pilot[None], condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not condition():
            await user.pause(0.01)


def text(screen: Teleop) -> str:
    """The facts as plain text."""
    console = Console(width=60)
    with console.capture() as captured:
        console.print(screen.query_one("#facts", Static).content)
    return captured.get()
