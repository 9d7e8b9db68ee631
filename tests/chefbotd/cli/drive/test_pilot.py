"""Keys turned into commands over the socket, on a virtual clock."""

import asyncio
import itertools
from collections.abc import Awaitable, Callable

import pytest

from chefbotd.cli.drive.control import Pilot
from chefbotd.client import Client, ConnectionLost
from tests.chefbotd.cli.fake_daemon import FakeDaemon

Script = Callable[[Pilot], Awaitable[None]]


def fly(daemon: FakeDaemon, script: Script, complaints: list[str] | None = None) -> list[tuple[float, str]]:
    """Run a pilot while ``script`` presses keys: what was asked of the daemon, in seconds from the beginning."""

    async def main() -> float:
        async with Client.connect("127.0.0.1", daemon.port) as robot:
            pilot = Pilot(robot, (complaints if complaints is not None else []).append)
            began_s = asyncio.get_running_loop().time()
            running = asyncio.create_task(pilot.run())
            await script(pilot)
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
            return began_s

    began_s = daemon.run(main())
    return [(round(at_s - began_s, 3), name) for at_s, name, _ in daemon.calls]


async def hold(pilot: Pilot, key: str, seconds: float) -> None:
    """A key held down on a keyboard that repeats after 0.5 s, every 30 ms."""
    pilot.press(key)
    held_s = await _pass(0.5)
    while held_s < seconds - 1e-6:
        pilot.press(key)
        held_s += await _pass(0.03)


async def _pass(seconds: float) -> float:
    await asyncio.sleep(seconds)
    return seconds


def test_a_held_key_drives_at_20_hz_and_more(daemon: FakeDaemon) -> None:
    """While a key is held no two commands are more than 50 ms apart, and the first goes out at once."""

    async def script(pilot: Pilot) -> None:
        await hold(pilot, "i", 1.0)

    asked = fly(daemon, script)
    times = [at_s for at_s, name in asked if name == "drive"]
    assert times[0] == 0.0
    assert max(b - a for a, b in itertools.pairwise(times)) <= 0.051


def test_letting_go_ends_its_own_motion_once(daemon: FakeDaemon) -> None:
    """0.12 s after the last repeat of a key: zero, and the source given back. Nothing more, and no stop for others."""

    async def script(pilot: Pilot) -> None:
        await hold(pilot, "i", 0.59)  # arrives at 0, 0.50, 0.53 and 0.56 s
        await asyncio.sleep(2.0)

    asked = fly(daemon, script)
    assert asked[-1] == (pytest.approx(0.68, abs=0.002), "release_control")
    assert [name for _, name in asked if name != "drive"] == ["release_control"]
    assert [params for _, name, params in daemon.calls if name == "drive"][-1] == {
        "linear_m_s": 0.0,
        "angular_rad_s": 0.0,
    }


def test_a_stop_key_stops_whoever_drives_and_the_next_key_drives(daemon: FakeDaemon) -> None:
    """Space in mid-drive is one stop, and a key pressed 0.1 s later drives again."""

    async def script(pilot: Pilot) -> None:
        pilot.press("i")
        await asyncio.sleep(0.12)
        pilot.press(" ")
        await asyncio.sleep(0.1)
        pilot.press("j")
        await asyncio.sleep(0.01)

    asked = fly(daemon, script)
    assert [name for at_s, name in asked if 0.11 < at_s < 0.21] == ["stop"]
    assert (0.22, "drive") in asked


def test_keys_pressed_at_once_keep_their_order(daemon: FakeDaemon) -> None:
    """Space and then a direction, before either could be sent: the stop goes first."""

    async def script(pilot: Pilot) -> None:
        pilot.press(" ")
        pilot.press("i")
        await asyncio.sleep(0.01)

    assert [name for _, name in fly(daemon, script)][:2] == ["stop", "drive"]


def test_a_stop_key_stops_even_at_rest(daemon: FakeDaemon) -> None:
    """The space bar sends a stop though this pilot drives nothing: another source may."""

    async def script(pilot: Pilot) -> None:
        pilot.press(" ")
        await asyncio.sleep(0.01)

    assert fly(daemon, script)[0] == (0.0, "stop")


def test_a_speed_key_sends_nothing(daemon: FakeDaemon) -> None:
    """Choosing a speed at rest asks nothing of the robot, to its end."""

    async def script(pilot: Pilot) -> None:
        pilot.press("+")
        await asyncio.sleep(1.0)

    assert fly(daemon, script) == []


def test_release_lets_go_at_once(daemon: FakeDaemon) -> None:
    """A lost focus ends the motion without waiting for the hold to run out."""

    async def script(pilot: Pilot) -> None:
        pilot.press("i")
        await asyncio.sleep(0.12)
        pilot.release()
        await asyncio.sleep(1.0)

    assert (0.12, "release_control") in fly(daemon, script)


def test_a_refusal_is_told_and_survived(daemon: FakeDaemon) -> None:
    """A refused command ends the motion with its kind told once; the pilot goes on."""
    daemon.refuse["drive"] = "estopped"
    complaints: list[str] = []

    async def script(pilot: Pilot) -> None:
        pilot.press("i")
        await asyncio.sleep(0.2)
        daemon.refuse.clear()
        pilot.press("j")
        await asyncio.sleep(0.1)

    asked = fly(daemon, script, complaints)
    assert complaints == ["estopped: it will not"]
    assert next(name for at_s, name in asked if at_s >= 0.2) == "drive"


def test_a_lost_connection_ends_it(daemon: FakeDaemon) -> None:
    """When the daemon goes away the pilot says so, rather than pretend to drive."""
    daemon.hang_up_on = "drive"

    async def main() -> None:
        async with Client.connect("127.0.0.1", daemon.port) as robot:
            pilot = Pilot(robot, lambda _text: None)
            pilot.press("i")
            await pilot.run()

    with pytest.raises(ConnectionLost):
        daemon.run(main())


def test_a_key_held_while_the_computer_was_suspended_drives_no_more(
    daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loop's clock stood meanwhile, so that the key still counts as held: the pilot says why it drives no more."""

    async def script(pilot: Pilot) -> None:
        await hold(pilot, "i", 1.0)
        monkeypatch.setattr("chefbotd.client.sleep_watch.suspended_s", lambda: 3600.0)
        await asyncio.sleep(1.0)

    complaints: list[str] = []
    asked = fly(daemon, script, complaints)
    assert max(at_s for at_s, name in asked if name == "drive") <= 1.06
    assert [text for text in complaints if "did not run for 3599.9 s" in text]
