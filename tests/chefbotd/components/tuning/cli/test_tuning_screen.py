"""The tuning screen, headless: what is on it, and what its keys ask of the daemon and write to the file."""

import asyncio
import contextlib
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from rich.console import Console
from textual import events
from textual.pilot import Pilot
from textual.widgets import Static
from textual_hires_canvas import Canvas

from chefbotd.cli.common.exits import Exit
from chefbotd.client import Client, ConnectionLost
from chefbotd.components.tuning.cli import tuning_screen
from chefbotd.components.tuning.cli.excitation import Wave
from chefbotd.components.tuning.cli.plots import WheelPlot
from chefbotd.components.tuning.cli.tuning_screen import Tune, tune
from chefbotd.settings import load
from tests.budget import sample
from tests.chefbotd.cli.fake_daemon import PID, WHEELS, FakeDaemon
from tests.chefbotd.conftest import Control
from tests.robot_files import full
from tests.waiting import PATIENCE_S

Script = Callable[[Tune, Pilot[None]], Awaitable[None]]


def on_screen(daemon: FakeDaemon, script: Script, config: Path | None = None, *, waits: bool = True) -> Tune:
    """Run the screen at 80x24 on the real clock (Textual has its own) while ``script`` plays the user.

    The user ``waits`` until the gains are there.
    """

    async def main() -> Tune:
        async with Client.connect("127.0.0.1", daemon.port) as robot:
            screen = Tune(robot, "robot:7333", config, Wave(0.1, 1.5))
            async with screen.run_test(size=(80, 24)) as user:
                await until(user, lambda: not waits or "i limit" in side(screen))
                await script(screen, user)
            return screen

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tuning_screen, "SHOWN_HZ", 4.0)  # drawing is what costs time here
        return asyncio.run(daemon.beside(main()))


def test_it_shows_wheels_and_gains(daemon: FakeDaemon) -> None:
    """Every gain with its value, every wheel with its error, and curves in all three plots, at 80x24."""

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await until(user, lambda: "left 0.500 rms" in side(screen))  # 1.5 asked, 1.0 done, always
        told = side(screen)
        for words in ("wheel all", "kp 400", "ki 100", "back calc off", "cond int on", "right 0.000 rms"):
            assert words in told
        plots = list(screen.query(WheelPlot))
        assert [plot.size.width for plot in plots] == [52] * 3
        assert screen.query_one("#help").region.bottom == 23
        await until(user, lambda: all(braille(plot) for plot in plots))

    on_screen(daemon, script)


def test_keys_change_the_chosen_gain(daemon: FakeDaemon) -> None:
    """Down chooses ki; right and left are 10 % up and down on all wheels, brackets 1 %."""

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press("down", "right", "right_square_bracket", "left_square_bracket", "left", "up", "left")
        await until(user, lambda: len(changes(daemon)) == 5)

    screen = on_screen(daemon, script)
    assert changes(daemon) == [
        {"wheel": "all", "ki": 110.0},
        {"wheel": "all", "ki": 111.1},
        {"wheel": "all", "ki": 110.0},
        {"wheel": "all", "ki": 100.0},
        {"wheel": "all", "kp": 363.6},
    ]
    assert screen.unsaved


@pytest.mark.slow
def test_one_wheel_alone(daemon: FakeDaemon) -> None:
    """Tab chooses a wheel; where wheels differ, all of them says so."""

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press("tab", "tab", "right")
        await until(user, lambda: "kp 440" in side(screen))
        await user.press("tab")
        await until(user, lambda: "kp 400 (differ)" in side(screen))

    on_screen(daemon, script)
    assert changes(daemon) == [{"wheel": WHEELS[1], "kp": 440.0}]


@pytest.mark.slow
def test_undo(daemon: FakeDaemon) -> None:
    """What was changed is taken back, and then nothing is unsaved."""

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press("right", "u")
        await until(user, lambda: message(screen) == "Undone.")
        await until(user, lambda: "kp 400" in side(screen))

    assert not on_screen(daemon, script).unsaved


def test_save(daemon: FakeDaemon, tmp_path: Path) -> None:
    """The gains go to the file that was named, and nothing is unsaved any more."""
    config = tmp_path / "robot.toml"
    config.write_bytes(full().read_bytes())

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press("right", "s")
        await until(user, lambda: message(screen).startswith("Saved to"))

    assert not on_screen(daemon, script, config).unsaved
    assert load(config).pid.kp == 440.0


def test_what_is_saved_is_what_the_robot_has(daemon: FakeDaemon, tmp_path: Path) -> None:
    """Another client has changed the gains since they were shown."""
    config = tmp_path / "robot.toml"
    config.write_bytes(full().read_bytes())

    async def script(screen: Tune, user: Pilot[None]) -> None:
        daemon.gains.append({wheel: {**PID, "kp": 432.1} for wheel in WHEELS})
        await user.press("s")
        await until(user, lambda: message(screen).startswith("Saved to"))

    assert not on_screen(daemon, script, config).unsaved
    assert load(config).pid.kp == 432.1


def test_save_before_the_gains_are_there(daemon: FakeDaemon, tmp_path: Path) -> None:
    """It waits for them; none at all were saved, which was refused."""
    config = tmp_path / "robot.toml"
    config.write_bytes(full().read_bytes())
    daemon.latency_s = 0.3

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press("s")
        await until(user, lambda: message(screen).startswith("Saved to"))

    assert not on_screen(daemon, script, config, waits=False).unsaved
    assert load(config).pid.kp == PID["kp"]


@pytest.mark.parametrize("broken", [True, False])
def test_save_without_a_file(daemon: FakeDaemon, tmp_path: Path, broken: bool) -> None:
    """Without a file, or with one that is no configuration, it says so, and goes on."""
    config = tmp_path / "robot.toml"
    config.write_text("[pid]\n")

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press("s")
        await until(user, lambda: ("not saved" if broken else "start with --config") in message(screen))

    on_screen(daemon, script, config if broken else None)


def test_excitation_is_asked_for_twice(daemon: FakeDaemon) -> None:
    """The first ``e`` asks about the wheels; the second drives; a third stops."""

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press("e")
        assert "off the ground" in message(screen)
        assert "drive" not in daemon.methods()
        await user.press("e")
        await until(user, lambda: "drive" in daemon.methods() and "excited" in side(screen))
        await user.press("e")
        await until(user, lambda: "release_control" in daemon.methods())

    on_screen(daemon, script)
    assert "stop" not in daemon.methods()


@pytest.mark.slow
def test_another_key_is_no_confirmation(daemon: FakeDaemon) -> None:
    """Between the two ``e`` no other key may come."""

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press("e", "down", "e")
        assert "off the ground" in message(screen)

    on_screen(daemon, script)
    assert "drive" not in daemon.methods()


@pytest.mark.parametrize(
    ("end", "last"), sample([("space", "stop"), ("blur", "release_control"), ("escape", "release_control")])
)
def test_excitation_ends(daemon: FakeDaemon, end: str, last: str) -> None:
    """The space bar stops the robot; a lost focus and leaving end its own motion and hold nobody."""

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press("e", "e")
        await until(user, lambda: "drive" in daemon.methods())
        if end == "blur":
            screen.post_message(events.AppBlur())
        else:
            await user.press(end)
        if end != "escape":
            await until(user, lambda: last in daemon.methods())

    on_screen(daemon, script)
    asked = [name for name in daemon.methods() if name in ("drive", "stop", "release_control")]
    assert (asked[0], asked[-1]) == ("drive", last)
    assert ("stop" in asked) is (last == "stop")


@pytest.mark.parametrize(("key", "method"), [("exclamation_mark", "estop"), ("f2", "arm")])
def test_keys_lock_and_arm(daemon: FakeDaemon, key: str, method: str) -> None:
    """``!`` is the emergency stop, ``a`` clears what has latched by then, as in teleop."""
    daemon.latch = 0x1F3A07C2 * 2**20 + 3

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press(key)
        await until(user, lambda: method in daemon.methods())

    on_screen(daemon, script)
    given = {name: given for _, name, given in daemon.calls}
    assert method == "estop" or given["arm"] == {"latch": daemon.latch}


@pytest.mark.slow
def test_refusals_are_shown(daemon: FakeDaemon) -> None:
    """A gain out of range, and a wave that may not be driven, are told on the message line."""
    daemon.refuse.update(set_pid="out_of_range", drive="disarmed")

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press("right")
        await until(user, lambda: message(screen) == "out_of_range: it will not")
        await user.press("e", "e")
        await until(user, lambda: message(screen) == "disarmed: it will not")

    assert not on_screen(daemon, script).unsaved


def test_a_lost_connection_ends_it(daemon: FakeDaemon) -> None:
    """When the daemon goes away the screen closes and says why."""
    daemon.hang_up_on = "set_pid"

    async def script(screen: Tune, user: Pilot[None]) -> None:
        await user.press("right")
        await until(user, lambda: screen.failure is not None)

    assert isinstance(on_screen(daemon, script).failure, ConnectionLost)


@pytest.mark.slow
@pytest.mark.parametrize("lost", [True, False])
def test_unsaved_gains_are_told_whatever_ends_it(
    daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch, lost: bool
) -> None:
    """The user leaves, or the daemon goes away: the commands that bring the changed gains back are told."""
    told: list[list[str]] = []

    async def played(screen: Tune, **_: object) -> None:
        async with screen.run_test(size=(80, 24)) as user:
            await until(user, lambda: "i limit" in side(screen))
            await user.press("right")
            await until(user, lambda: screen.unsaved)
            daemon.hang_up_on = "get_pid" if lost else None
            await until(user, lambda: screen.failure is not None or not lost)

    monkeypatch.setattr(Tune, "run_async", played)  # in the terminal's place

    async def main() -> None:
        async with Client.connect("127.0.0.1", daemon.port) as robot:
            await tune(robot, "robot:7333", None, Wave(0.1, 1.5), told.append)

    with pytest.raises(ConnectionLost) if lost else contextlib.nullcontext():
        asyncio.run(daemon.beside(main()))
    assert told == [["chefbotctl pid set all kp=440.0"]]


def test_without_the_extra(control: Control, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without its packages the command says what to install, and exits with 7."""
    monkeypatch.setitem(sys.modules, "textual_plot", None)
    for module in ("plots", "tuning_screen"):
        monkeypatch.delitem(sys.modules, f"chefbotd.components.tuning.cli.{module}")
    result = control("pid", "tune")
    assert result.exit_code == Exit.NOT_INSTALLED
    assert "pip install 'chefbotd[tune]'" in result.stderr


async def until(user: Pilot[None], condition: Callable[[], bool]) -> None:
    """Wait, at most a minute."""
    async with asyncio.timeout(PATIENCE_S):
        while not condition():
            await user.pause(0.01)


def changes(daemon: FakeDaemon) -> list[dict[str, object]]:
    """The changes of gains that were asked for."""
    return [given for _, name, given in daemon.calls if name == "set_pid"]


def message(screen: Tune) -> str:
    """The line for messages."""
    return str(screen.query_one("#message", Static).content)


def side(screen: Tune) -> str:
    """Gains and errors as plain text, with single spaces."""
    console = Console(width=40, color_system=None)
    with console.capture() as captured:
        console.print(screen.query_one("#gains", Static).content)
    return " ".join(captured.get().split())


def braille(plot: WheelPlot) -> bool:
    """Whether a curve is drawn."""
    canvas = plot.query_one("#plot", Canvas)
    cells = (canvas.get_pixel(x, y)[0] for x in range(canvas.size.width) for y in range(canvas.size.height))
    return any("\u2800" < cell <= "\u28ff" for cell in cells)
