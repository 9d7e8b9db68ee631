"""A pad driving a robot over the socket, on a virtual clock."""

import asyncio
import sys
from collections.abc import Awaitable, Callable

import pytest

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive.gamepad import Button, PadReading, StickScale
from chefbotd.cli.drive.joystick import JoystickPilot
from chefbotd.client import Client, ConnectionLost
from tests.chefbotd.cli.fake_daemon import FakeDaemon
from tests.chefbotd.conftest import Control
from tests.waiting import PATIENCE_S

HELD = PadReading(1.0, 0.0, frozenset({Button.ENABLE}))


class FakePad:
    """A pad that is as the test says."""

    name = "Pad"

    def __init__(self) -> None:
        self.reading: PadReading | None = PadReading()

    def read(self) -> PadReading | None:
        return self.reading


Script = Callable[[FakePad], Awaitable[None]]


def fly(
    daemon: FakeDaemon,
    script: Script,
    said: list[str] | None = None,
    source: str | None = None,
    *,
    takes_over: bool = False,
) -> list[tuple[float, str, str | None]]:
    """Drive while ``script`` handles the pad: when what was asked of the daemon, and as whom."""

    async def main() -> float:
        pad = FakePad()
        async with Client.connect("127.0.0.1", daemon.port) as robot:
            say = (said if said is not None else []).append
            began_s = asyncio.get_running_loop().time()
            pilot = JoystickPilot(robot, pad, say, StickScale(), source, takes_over=takes_over)
            running = asyncio.create_task(pilot.run())
            await asyncio.sleep(0.05)
            await script(pad)
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
            return began_s

    began_s = daemon.run(main())
    return [(round(at_s - began_s, 2), name, given.get("source")) for at_s, name, given in daemon.calls]


async def drive(pad: FakePad) -> None:
    """The enable button held and the stick pushed for half a second."""
    pad.reading = HELD
    await asyncio.sleep(0.5)


def test_it_drives_and_lets_go(daemon: FakeDaemon) -> None:
    """Commands as ``joystick``; a look of 10 ms after the button its own target is zero, and its source given back."""

    async def script(pad: FakePad) -> None:
        await drive(pad)
        pad.reading = PadReading()
        await asyncio.sleep(1.0)

    asked = fly(daemon, script)
    speeds = [given["linear_m_s"] for _, name, given in daemon.calls if name == "drive"]
    assert speeds == [0.2] * (len(speeds) - 1) + [0.0]
    assert {source for _, name, source in asked if name == "drive"} == {"joystick"}
    assert [name for _, name, _ in asked][-2:] == ["drive", "release_control"]
    assert [at_s for at_s, _, _ in asked][-2:] == [pytest.approx(0.56, abs=0.011)] * 2
    assert "stop" not in daemon.methods()


@pytest.mark.parametrize("latency_s", [0.0, 0.001, 0.004, 0.03])
def test_it_drives_at_20_hz(daemon: FakeDaemon, latency_s: float) -> None:
    """In ten seconds 200 commands, one more or less, whatever time their answers take."""
    daemon.latency_s = latency_s

    async def script(pad: FakePad) -> None:
        pad.reading = HELD
        await asyncio.sleep(10.0)

    driven = [call for call in fly(daemon, script) if call[1] == "drive"]
    assert len(driven) == pytest.approx(201, abs=1)  # and the zero at the end


def test_a_hang_is_followed_by_no_burst(daemon: FakeDaemon) -> None:
    """Answers that take 0.3 s are waited for: no tenth of a second has more than its own two turns and a late one."""
    daemon.latency_s = 0.3

    async def script(pad: FakePad) -> None:
        pad.reading = HELD
        await asyncio.sleep(1.0)
        daemon.latency_s = 0.0
        await asyncio.sleep(0.5)

    times_s = [at_s for at_s, name, _ in fly(daemon, script) if name == "drive"]
    assert len(times_s) > 10
    assert all(sum(at_s <= other_s < at_s + 0.1 for other_s in times_s[:-1]) <= 3 for at_s in times_s)


def test_its_end_lets_go(daemon: FakeDaemon) -> None:
    """Ended while the button is held, its last commands are a target of zero and its source given back."""
    asked = fly(daemon, drive)
    assert [name for _, name, _ in asked][-2:] == ["drive", "release_control"]
    assert daemon.calls[-2][2]["linear_m_s"] == 0.0


@pytest.mark.parametrize(
    ("refused", "kind", "last"),
    [
        ("release_control", "rate_limited", ["drive", "release_control", "stop"]),
        ("drive", "lease_held", ["drive", "release_control"]),
    ],
)
def test_letting_go_that_is_refused(daemon: FakeDaemon, refused: str, kind: str, last: list[str]) -> None:
    """A target that is another's by now is left alone; a source that cannot be given back ends in a stop."""

    async def script(pad: FakePad) -> None:
        await drive(pad)
        await asyncio.sleep(0.02)  # between two turns
        daemon.refuse[refused] = kind
        pad.reading = PadReading()
        await asyncio.sleep(0.2)

    said: list[str] = []
    asked = [name for _, name, _ in fly(daemon, script, said)]
    assert asked[-len(last) :] == last
    assert said == []


def test_a_robot_without_that_source(daemon: FakeDaemon) -> None:
    """Where there is no source ``joystick`` the robot's default one speaks, from the first command on."""
    daemon.unknown_sources = {"joystick"}
    said: list[str] = []
    asked = fly(daemon, drive, said)
    assert [source for _, name, source in asked if name == "drive"][:3] == ["joystick", None, None]
    assert said == []


def test_a_source_that_was_asked_for(daemon: FakeDaemon) -> None:
    """It is used, or its absence told: nobody is driven as someone else."""
    daemon.unknown_sources = {"pilot"}
    said: list[str] = []
    asked = fly(daemon, drive, said, source="pilot")
    assert [source for _, name, source in asked if name == "drive"] == ["pilot"]
    assert said == ["unknown_source: it will not"]


def test_stop_estop_and_arm(daemon: FakeDaemon) -> None:
    """Each is told; arming clears what has latched by then and nothing after it."""
    said: list[str] = []
    daemon.latch = 0x1F3A07C2 * 2**20 + 3

    async def script(pad: FakePad) -> None:
        for button in (Button.STOP, Button.ESTOP, Button.ARM):
            pad.reading = PadReading(down=frozenset({button}))
            await asyncio.sleep(0.1)

    asked = fly(daemon, script, said)
    assert [name for _, name, _ in asked] == ["stop", "estop", "get_state", "arm"]
    assert daemon.calls[-1][1:] == ("arm", {"latch": daemon.latch})
    assert said == ["Stopped; nobody was driving.", "Emergency stop; Start arms again.", "Armed."]


def test_an_unplugged_pad(daemon: FakeDaemon) -> None:
    """It lets go, the driver is told, and told again when the pad is back."""
    said: list[str] = []

    async def script(pad: FakePad) -> None:
        await drive(pad)
        pad.reading = None
        await asyncio.sleep(0.1)
        pad.reading = HELD
        await asyncio.sleep(0.1)

    assert [name for _, name, _ in fly(daemon, script, said)][-2:] == ["drive", "release_control"]
    assert said == ["Pad is gone: it drives no more", "Pad is back"]


def test_a_refusal_is_told_once(daemon: FakeDaemon) -> None:
    """One command, one message; the next press tries again."""
    daemon.refuse["drive"] = "disarmed"
    said: list[str] = []

    async def script(pad: FakePad) -> None:
        for one in (HELD, PadReading(), HELD):
            pad.reading = one
            await asyncio.sleep(0.3)

    assert [name for _, name, _ in fly(daemon, script, said)] == ["drive", "drive"]
    assert said == ["disarmed: it will not"] * 2


def test_no_pad(daemon: FakeDaemon) -> None:
    """Without a pad to begin with it ends, and says what to look at."""

    async def main() -> None:
        pad = FakePad()
        pad.reading = None
        async with asyncio.timeout(PATIENCE_S), Client.connect("127.0.0.1", daemon.port) as robot:
            await JoystickPilot(robot, pad, lambda _text: None, StickScale()).run()

    with pytest.raises(ProgramError, match="no gamepad found"):
        daemon.run(main())


def test_a_lost_connection_ends_it(daemon: FakeDaemon) -> None:
    """When the daemon goes away the pilot says so."""
    daemon.hang_up_on = "drive"

    async def main() -> None:
        pad = FakePad()
        async with asyncio.timeout(PATIENCE_S), Client.connect("127.0.0.1", daemon.port) as robot:
            asyncio.get_running_loop().call_later(0.1, setattr, pad, "reading", HELD)
            await JoystickPilot(robot, pad, lambda _text: None, StickScale()).run()

    with pytest.raises(ConnectionLost):
        daemon.run(main())


def test_without_the_extra(control: Control, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without SDL the command says what to install, and exits with 7."""
    monkeypatch.setitem(sys.modules, "sdl2", None)
    monkeypatch.delitem(sys.modules, "chefbotd.cli.drive.sdl_gamepad", raising=False)
    result = control("joystick")
    assert result.exit_code == Exit.NOT_INSTALLED
    assert "pip install 'chefbotd[joystick]'" in result.stderr


def test_control_is_taken_of_the_source_that_the_robot_has(daemon: FakeDaemon) -> None:
    """First as ``joystick``; where the robot has no such source, as its default one, which then drives too."""
    daemon.unknown_sources = {"joystick"}
    done = fly(daemon, drive, takes_over=True)
    assert [(name, source) for _, name, source in done[:3]] == [
        ("take_control", "joystick"),
        ("take_control", None),
        ("drive", None),
    ]


def test_control_that_is_refused_ends_the_pilot(daemon: FakeDaemon) -> None:
    """A role that may not drive is the daemon's refusal, before anything moves."""
    daemon.refuse["take_control"] = "forbidden"
    assert [name for _, name, _ in fly(daemon, drive, takes_over=True)] == ["take_control"]
