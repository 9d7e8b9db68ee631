"""The whole daemon on the simulated robot, while clients die, quarrel, and misbehave."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from chefbotd.client import CallError, Client
from chefbotd.clock import run_virtual
from chefbotd.process import run as process
from chefbotd.settings import SettingsError, load
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample
from tests.scenarios.robots import OBEYED_S

Scenario = Callable[[SimulatedRobot], Awaitable[None]]

DEAD_MAN_S = 0.5


def on_robot(scenario: Scenario) -> None:
    """Run a scenario with the board up and the encoders coming in."""

    async def run() -> None:
        async with simulated_robot() as robot:
            await asyncio.sleep(1.0)
            await scenario(robot)

    with capture_logs():
        run_virtual(run())


@contextlib.asynccontextmanager
async def another(robot: SimulatedRobot, name: str) -> AsyncIterator[Client]:
    """One more client, with a name."""
    host, port = await robot.daemon.server.address()
    async with Client.connect(host, port, name=name) as client:
        yield client


async def drive(client: Client, linear_m_s: float, seconds: float, source: str = "teleop") -> None:
    """Repeat a command at 20 Hz."""
    for _ in range(round(seconds / 0.05)):
        await client.drive(linear_m_s, 0.0, source)
        await asyncio.sleep(0.05)


def speed_m_s(robot: SimulatedRobot) -> float:
    """How fast the robot really goes."""
    return robot.board.truth(0.0).twist.linear_m_s


async def safety(robot: SimulatedRobot) -> dict[str, object]:
    """The latest of the topic ``safety``."""
    state: dict[str, object] = (await robot.client.call("get_state"))["safety"]
    return state


async def connected(robot: SimulatedRobot) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """A client that speaks what it likes."""
    host, port = await robot.daemon.server.address()
    return await asyncio.open_connection(host, port)


async def say(robot: SimulatedRobot, data: bytes, repeat: int = 1) -> asyncio.StreamWriter:
    """Connect and send, then leave the connection as it is."""
    _, writer = await connected(robot)
    with contextlib.suppress(ConnectionError):
        for _ in range(repeat):
            writer.write(data)
            await writer.drain()
    return writer


@pytest.mark.parametrize("abrupt", [False, True])
def test_the_robot_stops_when_its_driver_is_gone(abrupt: bool):
    """Closed in good order or reset: the duty falls at once, the robot stands within the dead-man time and its ramp."""

    async def scenario(robot: SimulatedRobot) -> None:
        line = b'{"jsonrpc":"2.0","method":"drive","params":{"linear_m_s":0.2,"angular_rad_s":0.0}}\n'
        _, writer = await connected(robot)
        for _ in range(30):
            writer.write(line)
            await asyncio.sleep(0.05)
        assert speed_m_s(robot) == pytest.approx(0.2, rel=0.05)
        assert len((await safety(robot))["control"]) == 1
        writer.transport.abort() if abrupt else writer.close()
        # 0.2 m/s at 1 m/s2 is a ramp of 0.2 s; the dead-man alone would have it start only after 0.5 s.
        await asyncio.sleep(0.35)
        assert speed_m_s(robot) < 0.02
        state = await safety(robot)
        assert (state["mode"], state["control"]) == ("armed", {})

    on_robot(scenario)


def test_navigation_goes_on_after_the_driver_is_gone():
    """A lost joystick hands over to the lower source once its last word is older than the dead-man time."""

    async def scenario(robot: SimulatedRobot) -> None:
        async with another(robot, "joystick") as joystick:
            navigating = asyncio.ensure_future(drive(robot.client, 0.1, 4.0, "navigation"))
            await drive(joystick, 0.2, 1.5)
            assert speed_m_s(robot) == pytest.approx(0.2, rel=0.05)
        await asyncio.sleep(DEAD_MAN_S + 0.5)
        assert (await safety(robot))["source"] == "navigation"
        assert speed_m_s(robot) == pytest.approx(0.1, rel=0.05)
        await navigating

    on_robot(scenario)


def test_one_drives_and_everyone_can_see_who():
    """The second driver is refused by name; it takes over, and the first is refused in its turn."""

    async def scenario(robot: SimulatedRobot) -> None:
        async with another(robot, "Ann") as ann, another(robot, "Bob") as bob:
            await drive(ann, 0.2, 1.0)
            with pytest.raises(CallError, match="controlled by Ann") as caught:
                await bob.drive(-0.2, 0.0)
            assert caught.value.kind == "lease_held"
            holder = (await safety(robot))["control"]
            assert str(holder).startswith("{'teleop': 'Ann (127.0.0.1:")
            assert str(await bob.take_control()).startswith("Ann")
            await asyncio.sleep(0.5)
            assert abs(speed_m_s(robot)) < 0.02
            with pytest.raises(CallError, match="controlled by Bob"):
                await ann.drive(0.2, 0.0)
            await drive(bob, -0.2, 1.0)
            assert speed_m_s(robot) == pytest.approx(-0.2, rel=0.05)
            await bob.release_control()
            await ann.drive(0.2, 0.0)

    on_robot(scenario)


def test_a_driver_that_falls_silent_gives_the_robot_up():
    """Three seconds after its last drive anyone may drive, and the topic says that nobody does."""

    async def scenario(robot: SimulatedRobot) -> None:
        async with another(robot, "Ann") as ann:
            await drive(ann, 0.1, 0.5)
            await asyncio.sleep(3.4)
            assert (await safety(robot))["control"] == {}
            await drive(robot.client, 0.1, 0.2)

    on_robot(scenario)


def test_anyone_may_stop_and_estop_whoever_drives():
    """Another client's stop ends the motion, its estop latches; the driver's lease is no shield.

    The stop holds the driver until it has said nothing for 1 s.
    """

    async def scenario(robot: SimulatedRobot) -> None:
        async with another(robot, "Ann") as ann:
            await drive(ann, 0.2, 1.0)
            await robot.client.stop()
            await asyncio.sleep(0.4)
            assert abs(speed_m_s(robot)) < 0.02
            await refused(ann, "stopped")
            await asyncio.sleep(1.0)
            await ann.arm()  # another client's stop holds her source until she asks anew
            await drive(ann, 0.2, 1.0)
            await robot.client.estop("smoke")
            await asyncio.sleep(OBEYED_S)
            assert robot.board.duty == (0, 0)
            with pytest.raises(CallError) as caught:
                await ann.drive(0.2, 0.0)
            assert caught.value.kind == "estopped"

    on_robot(scenario)


async def refused(client: Client, kind: str) -> CallError:
    """A drive is refused so."""
    with pytest.raises(CallError) as caught:
        await client.drive(0.2, 0.1)
    assert caught.value.kind == kind
    return caught.value


@pytest.mark.parametrize("way", ["stop", "estop"])
def test_who_repeats_through_a_stop_is_held_until_it_lets_go_or_asks_anew(way: str):
    """Ann repeats for 5 s through Bob's stop, or through an e-stop that Bob leaves by arm: the robot stands.

    So it does for navigation, which began only after the stop was latched. Ann's own arm lets her drive at once.
    """

    async def scenario(robot: SimulatedRobot) -> None:
        async with another(robot, "Ann") as ann, another(robot, "Bob") as bob:
            await drive(ann, 0.2, 1.0)
            await (bob.stop() if way == "stop" else bob.estop("smoke"))
            kinds = ["stopped"] * 100 if way == "stop" else ["estopped"] * 50 + ["stopped"] * 50
            for i, kind in enumerate(kinds):
                if way == "estop" and i == 50:
                    await bob.arm()
                await refused(ann, kind)
                await asyncio.sleep(0.05)
            assert speed_m_s(robot) == 0.0
            await ann.arm()
            await drive(ann, 0.2, 1.0)
            assert speed_m_s(robot) == pytest.approx(0.2, rel=0.05)

    on_robot(scenario)


def test_who_begins_to_drive_during_an_estop_is_held_after_it():
    """Nobody drove before; Ann tries while it is latched, somebody arms: she moves the robot after a second's pause."""

    async def scenario(robot: SimulatedRobot) -> None:
        async with another(robot, "Ann") as ann, another(robot, "Bob") as bob:
            await bob.estop("smoke")
            await refused(ann, "estopped")
            await bob.arm()
            await refused(ann, "stopped")
            await drive(bob, 0.1, 0.5, "navigation")
            await asyncio.sleep(0.55)
            await drive(ann, 0.2, 0.5)

    on_robot(scenario)


@pytest.mark.parametrize("way", ["own stop", "stop", "estop"])
def test_who_tries_to_drive_what_another_client_has_is_held_by_a_stop_too(way: str):
    """Ann drives and Bob tries at 10 Hz; Ann or Carl stops, and Ann lets go. Bob moves nothing until he has let go.

    Ann had the source for 3 s after her last drive. Bob's first drive after that would have moved the robot.
    """

    async def scenario(robot: SimulatedRobot) -> None:
        async with another(robot, "Ann") as ann, another(robot, "Bob") as bob, another(robot, "Carl") as carl:
            await drive(ann, -0.2, 0.5)
            await refused(bob, "lease_held")
            await (ann.stop() if way == "own stop" else carl.stop() if way == "stop" else carl.estop("smoke"))
            for _ in range(28):
                await refused(bob, "lease_held")
                await asyncio.sleep(0.1)
            if way == "estop":
                await ann.arm()
            await asyncio.sleep(0.3)
            for _ in range(10):
                assert (await refused(bob, "stopped")).message.startswith("teleop was stopped by ")
                await asyncio.sleep(0.1)
            assert speed_m_s(robot) == 0.0
            await asyncio.sleep(1.0)
            await drive(bob, 0.2, 0.5)

    on_robot(scenario)


def test_connections_that_come_and_go_for_each_drive_are_held_as_well():
    """Ten a second, each with one drive and an end: after a stop not one of them moves the robot."""

    async def scenario(robot: SimulatedRobot) -> None:
        line = b'{"jsonrpc":"2.0","id":1,"method":"drive","params":{"linear_m_s":0.2,"angular_rad_s":0.1}}\n'

        async def once() -> bytes:
            reader, writer = await connected(robot)
            writer.write(line)
            await reader.readline()
            answer = await reader.readline()
            writer.close()
            return answer

        for _ in range(10):
            assert b'"result"' in await once()
            await asyncio.sleep(0.1)
        await robot.client.stop()
        for _ in range(30):
            assert b'"kind":"stopped"' in await once()
            await asyncio.sleep(0.1)
        assert speed_m_s(robot) == 0.0
        await asyncio.sleep(1.0)
        assert b'"result"' in await once()

    on_robot(scenario)


BODY = b"x" * 65_536
ABUSE = {
    "HTTP": (b"POST / HTTP/1.1\r\nContent-Length: 99999999\r\n\r\n", BODY),
    "TLS": (bytes.fromhex("16030100c8010000c40303"), BODY),
    "garbage": (bytes(range(256)), BODY),
    "lines": (b"", b"nonsense\n" * 7000),
    "pings": (b"", b'{"jsonrpc":"2.0","id":1,"method":"ping"}\n' * 1500),
    "an endless request": (b'{"jsonrpc":"2.0","id":1,"method":"', BODY),
    "an open request": (b'{"jsonrpc":"2.0"', b""),
    "nothing": (b"", b""),
}


@pytest.mark.parametrize(("first", "body"), sample(ABUSE.values(), fast=2), ids=ABUSE)
def test_a_driver_is_not_disturbed_by_what_others_send(first: bytes, body: bytes):
    """Ten abusers at once: every drive is answered, no control step is missed, and the room is free again."""

    async def scenario(robot: SimulatedRobot) -> None:
        abusers = await asyncio.gather(*(say(robot, first + body, repeat=4) for _ in range(10)))
        before = await robot.client.call("get_stats")
        await drive(robot.client, 0.2, 1.5)
        assert speed_m_s(robot) == pytest.approx(0.2, rel=0.05)
        after = await robot.client.call("get_stats")
        frames = after["frames"]["EncoderCounts"] - before["frames"]["EncoderCounts"]
        assert after["control_steps"] - before["control_steps"] == frames > 25  # 1.5 s at 20 Hz
        for writer in abusers:
            writer.transport.abort()
        await asyncio.sleep(0.3)
        assert (await robot.client.call("get_stats"))["clients"] == 1

    on_robot(scenario)


def test_a_daemon_that_cannot_be_guarded_does_not_start(tmp_path: Path):
    """Tokens are configured and not there: exit code 78, the log says what to do, and no device was touched."""
    absent = tmp_path / "tokens"
    settings = load(overrides={"api.token_file": str(absent), "api.port": 0, "link.device": "/dev/null"})
    with capture_logs() as logs:
        assert process.run(settings) == 78
    assert [entry["event"] for entry in logs] == ["cannot serve"]
    assert f"{absent}: cannot be read" in logs[0]["error"]
    assert "openssl rand" in logs[0]["error"]


def test_listening_beyond_loopback_without_a_token_is_a_bad_configuration():
    """``--listen 0.0.0.0:7333`` alone is refused before anything starts, with the keys to set."""
    with pytest.raises(SettingsError, match=r"api\.host: .*api\.token_file") as caught:
        load(overrides={"api.host": "0.0.0.0"})
    assert "127.0.0.1" in str(caught.value)
