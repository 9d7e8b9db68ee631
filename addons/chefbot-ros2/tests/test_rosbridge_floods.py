"""Floods and odd messages at rosbridge: a stop comes through, everything is answered, nobody is cut off."""

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

import pytest
from chefbot_ros2.map_messages import String
from chefbot_ros2.rosbridge.dispatcher import LONGEST_BYTES
from chefbot_ros2.rosbridge.protocol import EXCESS_EVERY_S
from chefbot_ros2.rosbridge.server import PARAMETERS, Server
from websockets.asyncio.client import ClientConnection, connect

from chefbotd.client import CannotConnect
from chefbotd.clock import run_virtual

PATIENCE_S = 100.0
STOP = '{"op":"call_service","service":"/estop","id":"stop"}'
ARM = '{"op":"call_service","service":"/arm","id":"arm"}'
DRIVE = '{"op":"publish","topic":"/cmd_vel","msg":{"linear":{"x":0.2}}}'
TOPICS = '{"op":"call_service","service":"/rosapi/topics","id":"topics"}'
MIXED = (DRIVE, TOPICS, '{"op":"subscribe","topic":"/odom"}', '{"op":"nonsense"}', "no JSON", ARM)


class FakeDaemon:
    """A daemon that does whatever it is asked; ``asked`` is what, in its order."""

    def __init__(self) -> None:
        self.hello = SimpleNamespace(auth="none")
        self.asked: list[str] = []
        self.stopped, self.called = asyncio.Event(), asyncio.Event()
        self.answers = asyncio.Event()
        self.answers.set()

    @asynccontextmanager
    async def connect_as(self, token: str | None, name: str) -> AsyncIterator[Any]:
        """The bridge's own connection never comes about."""
        if name == "rosbridge":
            raise CannotConnect("nobody there")
        yield self

    async def estop(self, reason: str) -> None:
        """The emergency stop."""
        self.asked.append("estop")
        self.stopped.set()

    async def call(self, method: str, **params: Any) -> None:
        """Any other method."""
        self.asked.append(method)
        self.called.set()
        await self.answers.wait()

    async def set_pose(self, *pose: float) -> None:
        """Where the robot is."""
        self.asked.append("set_pose")


class Bench:
    """The bridge, its daemon, and clients of it."""

    def __init__(self, server: Server, daemon: FakeDaemon, port: int) -> None:
        self.server, self.daemon, self._port = server, daemon, port

    def client(self) -> connect:
        """A client that reads."""
        return connect(f"ws://127.0.0.1:{self._port}", ping_interval=None, max_queue=None, max_size=None)


def serve(scenario: Callable[[Bench], Awaitable[None]]) -> None:
    """Run a scenario with the bridge."""

    async def served() -> None:
        daemon = FakeDaemon()
        server = Server(daemon.connect_as, None, "ros2")
        port: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        running = asyncio.create_task(server.run("127.0.0.1", 0, [], port.set_result))
        try:
            async with asyncio.timeout(PATIENCE_S):
                await scenario(Bench(server, daemon, await port))
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    run_virtual(served())


async def answer_to(client: ClientConnection, text: str, **words: Any) -> dict[str, Any]:
    """Send this; the first message after it with these members."""
    await client.send(text)
    async for said in client:
        message: dict[str, Any] = json.loads(said)
        if words.items() <= message.items():
            return message
    raise AssertionError("the connection was closed")


def test_a_stop_overtakes_twenty_thousand_messages_of_its_own_client() -> None:
    """It latches long before they could all be served, and the client stays."""

    async def scenario(bench: Bench) -> None:
        async with bench.client() as client:
            for number in range(20_000):
                await client.send(MIXED[number % len(MIXED)])
            assert (await answer_to(client, STOP, id="stop"))["values"]["success"] is True
            assert len(bench.daemon.asked) < 2 * PARAMETERS.requests_burst
            await asyncio.sleep(2 * EXCESS_EVERY_S)  # what comes too fast is told as a number, now and then
            assert (await answer_to(client, '{"op":"set_level"', op="status"))["level"] == "error"

    serve(scenario)


def test_a_stop_is_heard_beside_eight_floods() -> None:
    """It waits for one turn of each of the others at most, and not for what they have sent."""

    async def scenario(bench: Bench) -> None:
        async def flood(client: ClientConnection) -> None:
            for number in range(10_000):
                await client.send(MIXED[number % len(MIXED)])
                if number % 50 == 0:
                    await asyncio.sleep(0)

        clients = [await bench.client() for _ in range(8)]
        async with bench.client() as own:
            floods = [asyncio.create_task(flood(client)) for client in clients]
            await bench.daemon.called.wait()  # the floods have begun to be served
            await own.send(STOP)
            await bench.daemon.stopped.wait()
            assert not any(one.done() for one in floods)
            await asyncio.gather(*floods)
        for client in clients:
            assert (await answer_to(client, STOP, id="stop"))["result"] is True
            await client.close()

    serve(scenario)


def test_what_came_before_a_stop_does_not_arm_or_move_the_robot_after_it() -> None:
    """Of the same client and of others; each call says so by its id."""

    async def scenario(bench: Bench) -> None:
        async with bench.client() as client:
            for text in [*["x"] * PARAMETERS.requests_per_turn * 3, ARM, DRIVE]:
                await client.send(text)
            await client.send(STOP)
            assert "a stop by" in (await answer_to(client, TOPICS, id="arm"))["values"]["message"]
            assert bench.daemon.asked == ["estop"]
            assert (await answer_to(client, ARM, id="arm"))["values"]["success"] is True
            assert bench.daemon.asked == ["estop", "arm"]

    serve(scenario)


def test_a_stop_counts_whose_client_has_gone() -> None:
    """The connection is closed in the same moment."""

    async def scenario(bench: Bench) -> None:
        async with bench.client() as client:
            await client.send("x")
            await client.send(STOP)
        async with asyncio.timeout(10.0):
            await bench.daemon.stopped.wait()

    serve(scenario)


@pytest.mark.parametrize(
    "text",
    [
        '{"op":"call_service","service":"estop"}',
        '{"op":"call_service","service":"/estop","args":[[[1e999]]],"id":{"a":[NaN]}}',
        '{"op":"call_service","service":"/\\u0065stop"}',
        '{"op":"call_service","service":"/estop",}',
        '{"op":"call_service","service":"/estop","id":' + "9" * 5000 + "}",
        '{"op":"call_service","service":"/estop","args":' + "[" * 5000 + "]" * 5000 + "}",
    ],
    ids=["no slash", "odd members", "escaped", "a comma too many", "long number", "deep"],
)
def test_a_stop_counts_whatever_else_is_wrong_with_it(text: str) -> None:
    """Somebody who wants the robot to stop has no time for grammar."""

    async def scenario(bench: Bench) -> None:
        async with bench.client() as client:
            await client.send(text)
            async with asyncio.timeout(10.0):
                await bench.daemon.stopped.wait()

    serve(scenario)


ODD = {
    "throttle": '{"op":"subscribe","topic":"/odom","throttle_rate":1' + "0" * 400 + "}",
    "throttle infinite": '{"op":"subscribe","topic":"/odom","throttle_rate":1e999}',
    "throttle NaN": '{"op":"subscribe","topic":"/odom","throttle_rate":NaN}',
    "throttle text": '{"op":"subscribe","topic":"/odom","throttle_rate":"fast"}',
    "topic is a list": '{"op":"subscribe","topic":["/odom"]}',
    "topic is endless": '{"op":"subscribe","topic":"' + "o" * 5000 + '"}',
    "id is a list": '{"op":"subscribe","topic":"/odom","id":[1]}',
    "type is a number": '{"op":"advertise","topic":"/cmd_vel","type":7}',
    "goal NaN": '{"op":"publish","topic":"/goal_pose","msg":{"header":{"frame_id":"map"},'
    '"pose":{"position":{"x":NaN}}}}',
    "pose infinite": '{"op":"publish","topic":"/initialpose","msg":{"header":{"frame_id":"map"},'
    '"pose":{"pose":{"orientation":{"z":1e999}}}}}',
    "velocity infinite": '{"op":"publish","topic":"/cmd_vel","msg":{"linear":{"x":-1e999}}}',
    "velocity of many digits": '{"op":"publish","topic":"/cmd_vel","msg":{"linear":{"x":1'
    + "0" * 400
    + "}}}",
    "velocity is text": '{"op":"publish","topic":"/cmd_vel","msg":{"linear":"ahead"}}',
    "message is a list": '{"op":"publish","topic":"/cmd_vel","msg":[]}',
    "deep": "[" * 8000,
    "deep message": '{"op":"publish","topic":"/cmd_vel","msg":' + '{"linear":' * 1500 + "1" + "}" * 1501,
    "no JSON": "hello",
    "no object": "17",
    "op is a list": '{"op":["publish"]}',
    "number of 5000 digits": "9" * 5000,
    "half a letter": '{"op":"subscribe","topic":"/odom","compression":"\\ud800","id":"\\ud800"}',
    "empty": "",
    "too long": '{"op":"' + "x" * 200_000 + '"}',
    "fragment": '{"op":"fragment","data":"{","num":0,"total":2,"id":"1"}',
}


@pytest.mark.parametrize("text", ODD.values(), ids=ODD.keys())
def test_an_odd_message_is_answered_by_a_status_and_the_connection_stays(text: str) -> None:
    """Nothing reaches the daemon."""

    async def scenario(bench: Bench) -> None:
        async with bench.client() as client:
            status = await answer_to(client, text, op="status")
            assert status["level"] in ("error", "warning")
            assert "fault in the bridge" not in status["msg"]
            assert (await answer_to(client, TOPICS, id="topics"))["result"] is True
        assert bench.daemon.asked == []

    serve(scenario)


def test_bytes_that_are_no_text_are_answered_by_a_status() -> None:
    """A binary frame, as of a client that speaks CBOR."""

    async def scenario(bench: Bench) -> None:
        async with bench.client() as client:
            await client.send(b"\xa1\x62op\x68\xff\xfe")
            assert (await answer_to(client, "", op="status"))["level"] == "error"

    serve(scenario)


def test_each_of_a_hundred_calls_at_once_is_answered_by_its_id() -> None:
    """Those that the daemon is too slow for are refused, and say why."""

    async def scenario(bench: Bench) -> None:
        bench.daemon.answers.clear()
        async with bench.client() as client:
            for number in range(100):
                service = "/arm" if number % 2 else "/rosapi/topics"
                await client.send(
                    json.dumps({"op": "call_service", "service": service, "id": f"call {number}"})
                )
            answers = [json.loads(await client.recv()) for _ in range(50 + 50 - 32)]
            bench.daemon.answers.set()
            answers += [json.loads(await client.recv()) for _ in range(32)]
        assert {answer["id"] for answer in answers} == {f"call {number}" for number in range(100)}
        refused = [answer for answer in answers if not answer["result"]]
        assert len(refused) == 50 - 32
        assert all("wait already" in answer["values"] for answer in refused)

    serve(scenario)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"compression": "png"}, "plain JSON"),
        ({"compression": "cbor"}, "plain JSON"),
        ({"compression": "cbor-raw"}, "plain JSON"),
        ({"fragment_size": 500}, "whole"),
    ],
)
def test_who_asks_for_another_encoding_is_told_and_gets_plain_json(asked: dict[str, Any], said: str) -> None:
    """Not silence: the message comes."""

    async def scenario(bench: Bench) -> None:
        bench.server._hub.publish("/robot_description", String("urdf"))
        async with bench.client() as client:
            subscribe = {"op": "subscribe", "topic": "/robot_description", "id": "a", **asked}
            status = await answer_to(client, json.dumps(subscribe), op="status")
            assert (status["level"], status["id"]) == ("warning", "a")
            assert said in status["msg"]
            message = json.loads(await client.recv())
            assert (message["op"], message["msg"]) == ("publish", {"data": "urdf"})

    serve(scenario)


def test_a_message_is_served_up_to_its_longest() -> None:
    """One byte more is a status."""

    async def scenario(bench: Bench) -> None:
        async with bench.client() as client:
            padded = TOPICS[:-1] + " " * (LONGEST_BYTES - len(TOPICS)) + "}"
            assert (await answer_to(client, padded, id="topics"))["result"] is True
            too_long = padded[:-1] + " }"
            assert "too long" in (await answer_to(client, too_long, op="status"))["msg"]

    serve(scenario)
