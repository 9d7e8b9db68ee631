"""The client library, against the real server and against a far end that misbehaves."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
import uvloop

from chefbotd.client import (
    CallError,
    CallTimeout,
    CannotConnect,
    Client,
    ConnectionLost,
    Event,
    IncompatibleProtocol,
)
from chefbotd.client.models import TextData
from chefbotd.client.wire import Wire
from chefbotd.clock import run_virtual
from chefbotd.core.events import LineSeen, LinkOpened, TextReceived
from chefbotd.core.geometry import Pose2D, Twist2D
from tests.fakes.api import Served, serving
from tests.fakes.daemon import HELLO, Daemon, scripted
from tests.fakes.transport import FakeTransport


def with_robot(
    scenario: Callable[[Served, Client], Awaitable[None]],
    *,
    run: Callable[[Any], None] = run_virtual,
    **options: Any,
) -> None:
    """Run a scenario with the real server on a fake robot, and a client connected to it."""

    async def main() -> None:
        async with serving(**options) as served, Client.connect(served.host, served.port) as robot:
            await scenario(served, robot)

    run(main())


def with_script(
    script: Callable[[Daemon], Awaitable[None]],
    scenario: Callable[[str, int], Awaitable[None]],
    run: Callable[[Any], None] = run_virtual,
) -> None:
    """Run a scenario against a scripted far end."""

    async def main() -> None:
        async with scripted(script) as (host, port):
            await scenario(host, port)

    run(main())


@pytest.mark.parametrize("name", ["Ann", None])
def test_a_full_daemon_can_still_be_stopped(name: str | None) -> None:
    """A client without a place is told so when it asks for more, and its emergency stop is carried out."""

    async def scenario(served: Served, robot: Client) -> None:
        await robot.ping()
        async with Client.connect(served.host, served.port, name=name) as late:
            await late.ping()
            await late.estop("smoke")
            assert served.robot.calls == [("estop", "smoke")]
            with pytest.raises(
                CallError, match="already 1 clients; this connection is reserved for stop and estop"
            ):
                await late.drive(0.1, 0.0)

    with_robot(scenario, max_clients=1)


def test_an_estop_fits_a_line_whatever_its_reason() -> None:
    """A reason longer than a request may be is cut before it is sent."""

    async def scenario(served: Served, robot: Client) -> None:
        await robot.estop("smoke " * 10_000)
        ((_, reason),) = served.robot.calls
        assert len(reason) == 200

    with_robot(scenario)


@pytest.mark.parametrize("run", [run_virtual, uvloop.run])
def test_every_method_has_its_own(run: Callable[[Any], None]) -> None:
    """Each convenience method makes the call that it is named after, on either loop."""

    async def scenario(served: Served, robot: Client) -> None:
        await robot.drive(0.2, -0.1)
        await robot.drive(linear_m_s=0.0, angular_rad_s=1.0, source="navigation")
        await robot.set_wheel_velocities({"left": 1.0, "right": -2.0})
        await robot.stop()
        await robot.estop("smoke")
        await robot.estop()
        await robot.arm()
        await robot.reset_odometry(1.0, 2.0, 0.5)
        await robot.reset_board()
        assert await robot.take_control("safety") is None
        await robot.release_control()
        assert served.robot.calls == [
            ("drive", "teleop", Twist2D(0.2, -0.1)),
            ("drive", "navigation", Twist2D(0.0, 1.0)),
            ("set_wheel_velocities", "teleop", {"left": 1.0, "right": -2.0}),
            ("stop",),
            ("estop", "smoke"),
            ("estop", "asked by a client"),
            ("arm",),
            ("set_odometry", Pose2D(1.0, 2.0, 0.5)),
            ("reset_board",),
            *(("release", source) for source in ("teleop", "navigation", "safety")),
        ]
        assert (await robot.ping()).pong
        assert (await robot.get_state()).link.state == "down"
        assert (await robot.get_stats()).lines_out == 50
        assert set((await robot.describe()).methods) == set(robot_methods(robot))
        assert (await robot.set_pid("left", kp=3))["left"].kp == 3.0
        assert (await robot.get_pid())["left"].kp == 3.0

    with_robot(scenario, run=run)


def robot_methods(robot: Client) -> list[str]:
    """The methods that the greeting lists."""
    return [c.removeprefix("method.") for c in robot.hello.capabilities if c.startswith("method.")]


def test_the_greeting_is_at_hand() -> None:
    """After connecting it is known whom we talk to."""

    async def scenario(_: Served, robot: Client) -> None:
        assert (robot.hello.robot, robot.hello.link, robot.connected) == ("testbot", "down", True)

    with_robot(scenario)


def test_an_error_carries_code_kind_message_and_details() -> None:
    """A refusal is raised with all that the daemon said about it."""

    async def scenario(_: Served, robot: Client) -> None:
        with pytest.raises(CallError, match="linear_m_s") as caught:
            await robot.call("drive", linear_m_s="fast", angular_rad_s=0)
        assert (caught.value.code, caught.value.kind) == (-32602, "invalid_params")
        assert caught.value.data["fields"][0]["got"] == "'fast'"

    with_robot(scenario)


def test_calls_may_overlap() -> None:
    """Fifty calls at once each get their own answer."""

    async def scenario(_: Served, robot: Client) -> None:
        answers = await asyncio.gather(*(robot.ping() for _ in range(50)))
        assert all(a.pong for a in answers)

    with_robot(scenario)


def test_a_subscription_iterates_from_the_snapshot_on() -> None:
    """First the latest value, then what comes; leaving the block ends it at the daemon too."""

    async def scenario(served: Served, robot: Client) -> None:
        served.bus.publish(TextReceived(999.0, "before"))
        async with robot.subscribe(["text", "raw"]) as events:
            assert served.bus.has_listeners(LineSeen)
            assert await anext(events) == Event("text", 1, 999.0, 1.0, TextData(text="before"))
            served.bus.publish(TextReceived(1000.0, "after"))
            assert (await anext(events)).data.text == "after"
        assert not served.bus.has_listeners(LineSeen)
        await events.close()
        with pytest.raises(StopAsyncIteration):
            await anext(events)

    with_robot(scenario)


def test_a_plain_loop_subscribes_by_itself() -> None:
    """``async for`` needs no block around it; rate and policy go along."""

    async def scenario(served: Served, robot: Client) -> None:
        served.bus.publish(TextReceived(999.0, "hi"))
        async for event in robot.subscribe("text", max_rate_hz=5, policy="ordered"):
            assert event.data.text == "hi"
            break

    with_robot(scenario)


def test_two_subscriptions_to_a_topic_share_it() -> None:
    """Both get every event, and no other topic's; when one ends the other goes on."""

    async def scenario(served: Served, robot: Client) -> None:
        async with robot.subscribe(["text"]) as stays:
            async with robot.subscribe(["text"]) as leaves, robot.subscribe(["link"]) as other:
                served.bus.publish(TextReceived(1.0, "a"))
                served.bus.publish(LinkOpened(1.0, "/dev/ttyACM0"))
                assert (await anext(stays)).data.text == (await anext(leaves)).data.text == "a"
                assert (await anext(other)).topic == "link"
            served.bus.publish(TextReceived(2.0, "b"))
            assert (await anext(stays)).data.text == "b"

    with_robot(scenario)


def test_a_subscription_that_is_refused_can_be_closed() -> None:
    """An unknown topic raises on entering, and leaves nothing behind."""

    async def scenario(_: Served, robot: Client) -> None:
        events = robot.subscribe("lidar")
        with pytest.raises(CallError) as caught:
            await anext(events)
        assert caught.value.kind == "unknown_topic"
        await events.close()
        assert (await robot.ping()).pong

    with_robot(scenario)


def test_a_slow_reader_loses_the_oldest_and_sees_it() -> None:
    """Of five events in a queue of two the last two are left, and three are counted."""

    async def scenario(served: Served, robot: Client) -> None:
        async with robot.subscribe("text", policy="ordered", queue_size=2) as events:
            for i in range(5):
                served.bus.publish(TextReceived(0.0, str(i)))
            await asyncio.sleep(0.1)
            assert [(await anext(events)).data.text for _ in range(2)] == ["3", "4"]
            assert events.dropped == {"text": 3}

    with_robot(scenario)


def test_a_queue_needs_room() -> None:
    """A queue of nothing is a mistake, said at once."""

    async def scenario(_: Served, robot: Client) -> None:
        with pytest.raises(ValueError, match="queue_size"):
            robot.subscribe("text", queue_size=0)

    with_robot(scenario)


def test_what_the_daemon_dropped_is_counted() -> None:
    """A drop notice is added up on the client and on the subscriptions that it concerns."""

    async def script(daemon: Daemon) -> None:
        daemon.say(HELLO)
        await daemon.answer(topics=["text"])
        params = {"topics": {"text": 3, "imu": 1}, "total": 4}
        daemon.say({"jsonrpc": "2.0", "method": "dropped", "params": params})
        daemon.say({"jsonrpc": "2.0", "method": "something_newer", "params": {}})
        await daemon.answer(stamp_s=1.0)

    async def scenario(host: str, port: int) -> None:
        async with Client.connect(host, port) as robot:
            events = robot.subscribe("text")
            await events.__aenter__()
            await robot.ping()
            assert (robot.dropped, events.dropped) == ({"text": 3, "imu": 1}, {"text": 3})

    with_script(script, scenario)


def test_no_answer_in_time() -> None:
    """A silent daemon raises after the timeout; its late answer is nobody's, and the next call works."""

    async def script(daemon: Daemon) -> None:
        daemon.say(HELLO)
        late = await daemon.hear()
        assert (await daemon.hear())["params"] == {"id": late["id"]}  # of ``cancel``
        request = await daemon.hear()
        daemon.say({"jsonrpc": "2.0", "id": late["id"], "result": {"pong": True, "stamp_s": 1.0}})
        daemon.say({"jsonrpc": "2.0", "id": request["id"], "result": {"pong": True, "stamp_s": 2.0}})
        await asyncio.sleep(1.0)

    async def scenario(host: str, port: int) -> None:
        async with Client.connect(host, port, timeout_s=0.5) as robot:
            with pytest.raises(CallTimeout, match=r"ping within 0\.5 s"):
                await robot.ping()
            assert (await robot.ping()).stamp_s == 2.0

    with_script(script, scenario)


def test_a_call_that_was_given_up_is_nobodys() -> None:
    """When the connection goes down just as a caller gives up, the caller's own reason stands."""

    async def scenario() -> None:
        wire = Wire(lambda method, params: None, lambda loss: None)
        wire.connection_made(FakeTransport())
        calling = asyncio.ensure_future(wire.call("ping", {}, 1.0))
        await asyncio.sleep(0)
        calling.cancel()
        wire.connection_lost(None)
        with pytest.raises(asyncio.CancelledError):
            await calling

    run_virtual(scenario())


async def hang_up_on_second_request(daemon: Daemon) -> None:
    """Answer one request; close on the next."""
    daemon.say(HELLO)
    await daemon.answer(topics=["text"])
    await daemon.hear()


def test_a_lost_connection_is_told_to_everyone() -> None:
    """Who waits for an answer, who iterates, and who asks later: all get ``ConnectionLost``."""

    async def scenario(host: str, port: int) -> None:
        async with Client.connect(host, port) as robot:
            events = robot.subscribe("text")
            await events.__aenter__()
            iterating = asyncio.ensure_future(anext(events))
            with pytest.raises(ConnectionLost, match="closed the connection"):
                await robot.ping()
            for failing in (iterating, anext(events), robot.stop()):
                with pytest.raises(ConnectionLost):
                    await failing
            assert not robot.connected
            await events.close()

    with_script(hang_up_on_second_request, scenario)


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"garbage\n", "no JSON object"),
        (b"[1, 2]\n", "no JSON object"),
        (b"x" * 1_100_000, "a line of more than"),
    ],
)
def test_a_daemon_that_talks_nonsense_is_left(data: bytes, complaint: str) -> None:
    """Whatever is no JSON object, or has no end, ends the connection with a reason."""

    async def script(daemon: Daemon) -> None:
        daemon.say(HELLO)
        await daemon.hear()
        daemon.writer.write(data)
        await asyncio.sleep(1.0)

    async def scenario(host: str, port: int) -> None:
        async with Client.connect(host, port) as robot:
            with pytest.raises(ConnectionLost, match=complaint):
                await robot.ping()

    with_script(script, scenario)


def test_nobody_listens() -> None:
    """Connecting to a closed port raises what the system says."""

    async def scenario() -> None:
        async with serving() as served:
            pass
        with pytest.raises(CannotConnect, match="is chefbotd running there"):
            async with Client.connect(served.host, served.port):
                raise AssertionError("connected")

    run_virtual(scenario())


def test_a_full_daemon_says_why() -> None:
    """A client for which there is no place is refused, with the daemon's words, and its connection ends."""

    async def scenario(served: Served, robot: Client) -> None:
        await robot.ping()
        async with Client.connect(served.host, served.port) as second:
            with pytest.raises((CallError, ConnectionLost), match="already 1 clients"):
                await second.drive(0.1, 0.0)

    with_robot(scenario, max_clients=1, reserved_stop_connections=0)


def test_no_greeting_in_time() -> None:
    """Something else that listens there and says nothing is not taken for a daemon."""

    async def silent(daemon: Daemon) -> None:
        await asyncio.sleep(10.0)

    async def scenario(host: str, port: int) -> None:
        with pytest.raises(ConnectionLost, match="no greeting"):
            async with Client.connect(host, port, timeout_s=1.0):
                raise AssertionError("connected")

    with_script(silent, scenario)


def test_another_major_version_is_not_spoken() -> None:
    """A daemon of protocol 2 is refused before anything is asked of it."""

    async def newer(daemon: Daemon) -> None:
        daemon.say({**HELLO, "params": {**HELLO["params"], "protocol": "2.0"}})  # type: ignore[dict-item]
        await asyncio.sleep(1.0)

    async def scenario(host: str, port: int) -> None:
        with pytest.raises(IncompatibleProtocol, match=r"2\.0"):
            async with Client.connect(host, port):
                raise AssertionError("connected")

    with_script(newer, scenario)


def test_a_daemon_that_does_not_read_fills_no_memory() -> None:
    """Calls wait for room in the socket, and time out there instead of piling up."""

    async def deaf(daemon: Daemon) -> None:
        daemon.say(HELLO)
        daemon.writer.transport.pause_reading()  # type: ignore[attr-defined]
        await asyncio.sleep(60.0)
        daemon.writer.transport.abort()

    async def scenario(host: str, port: int) -> None:
        async with Client.connect(host, port, timeout_s=1.0) as robot:
            calls = (robot.call("ping", padding="x" * 100_000) for _ in range(200))
            outcomes = await asyncio.gather(*calls, return_exceptions=True)
            assert {type(o) for o in outcomes} == {CallTimeout}
            with pytest.raises(CallTimeout):
                await robot.ping()

    with_script(deaf, scenario)


def test_room_in_the_socket_is_waited_for() -> None:
    """A daemon that reads late still gets every call, and answers it."""

    async def late_reader(daemon: Daemon) -> None:
        daemon.say(HELLO)
        daemon.writer.transport.pause_reading()  # type: ignore[attr-defined]
        await asyncio.sleep(0.05)
        daemon.writer.transport.resume_reading()  # type: ignore[attr-defined]
        for _ in range(100):
            await daemon.answer()

    async def scenario(host: str, port: int) -> None:
        async with Client.connect(host, port) as robot:
            await asyncio.gather(*(robot.call("ping", padding="x" * 100_000) for _ in range(100)))

    with_script(late_reader, scenario, run=uvloop.run)


def test_an_event_of_a_newer_daemon_is_understood() -> None:
    """Fields that this client does not know are passed over, in events as in the greeting."""

    async def newer(daemon: Daemon) -> None:
        daemon.say(HELLO)
        await daemon.answer(topics=["text"])
        known = {"topic": "text", "seq": 1, "stamp_s": 2.0, "age_s": 0.5, "data": {"text": "hi"}}
        daemon.say({"jsonrpc": "2.0", "method": "event", "params": {**known, "priority": 3}})
        await daemon.answer(topics=[])

    async def scenario(host: str, port: int) -> None:
        async with Client.connect(host, port) as robot, robot.subscribe("text") as texts:
            assert await anext(texts) == Event("text", 1, 2.0, 0.5, TextData(text="hi"))

    with_script(newer, scenario)
