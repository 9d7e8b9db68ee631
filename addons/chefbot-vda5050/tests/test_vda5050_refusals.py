"""A broker that does not let a robot listen, another robot of its name, and a mistake of ours in one message."""

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import aiomqtt
import pytest
from chefbot_vda5050 import broker as module
from chefbot_vda5050.broker import Broker, BrokerParameters
from chefbot_vda5050.messages import Connection, ConnectionState, decode
from chefbot_vda5050.topics import Headers, Kind, RobotName
from structlog.testing import capture_logs

from chefbotd.clock import run_virtual

NAME = RobotName("chefbot", "r1")


class FakeClient:
    """A client of a broker that grants by ``codes``; the connection holds for ``holds_s``. One stands for all."""

    def __init__(self, codes: tuple[int, ...] = (0,), holds_s: float = 1e9) -> None:
        self._codes, self._holds_s = codes, holds_s
        self.connections = self.away = 0  # ``away``: so many attempts fail before each connection
        self.said: list[ConnectionState] = []
        self.listed: list[tuple[str, bytes]] = []

    def __call__(self, *words: object, **options: object) -> "FakeClient":
        """In place of the class of clients."""
        self.connections += 1
        return self

    async def __aenter__(self) -> "FakeClient":
        if self.connections % (self.away + 1):
            raise aiomqtt.MqttError("[Errno 111] Connection refused")
        return self

    async def __aexit__(self, *problem: object) -> None:
        pass

    async def subscribe(self, topic: str, qos: int) -> tuple[int, ...]:
        """As the broker answers."""
        return self._codes

    async def publish(self, topic: str, data: bytes, **options: Any) -> None:
        """What the robot says of its connection."""
        if topic == NAME.topic(Kind.CONNECTION):
            self.said.append(decode(data, Connection).connection_state)

    @property
    async def messages(self) -> AsyncIterator[aiomqtt.Message]:
        """Those that are listed; then the connection ends."""
        for topic, data in self.listed:
            yield aiomqtt.Message(topic, data, 0, False, 1, None)
        await asyncio.sleep(self._holds_s)
        raise aiomqtt.MqttError("Disconnected during message iteration")


def run(
    client: FakeClient, monkeypatch: pytest.MonkeyPatch, seconds: float, receive: Any = None
) -> list[Any]:
    """Have a robot on that broker for a time; what it logged."""
    monkeypatch.setattr(module.aiomqtt, "Client", client)
    online: list[bool] = []

    async def scenario() -> None:
        broker = Broker(
            BrokerParameters(),
            NAME,
            Headers(NAME, "2.1.0"),
            receive=receive or (lambda *message: None),
            online=online.append,
        )
        running = asyncio.create_task(broker.run())
        await asyncio.sleep(seconds)
        assert not running.done()
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    with capture_logs() as lines:
        run_virtual(scenario())
    return lines


@pytest.mark.parametrize("codes", [(0x80,), (0x87,), (0, 0x80)])
def test_a_robot_that_may_not_listen_is_not_online_and_says_why(
    codes: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An order would never reach it. It tries again, and less and less often."""
    client = FakeClient(codes)
    lines = run(client, monkeypatch, 600.0)
    assert set(client.said) == {ConnectionState.OFFLINE}
    assert 5 <= client.connections <= 20
    assert {line["log_level"] for line in lines} == {"error"}
    assert "refuses the subscription of 'uagv/v2/chefbot/r1/order'" in lines[0]["why"]


def test_two_robots_of_one_serial_number_back_off_and_say_who(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each connection ends after 0.2 s: the broker has given the name to the other one."""
    client = FakeClient(holds_s=0.2)
    lines = run(client, monkeypatch, 20.0)
    assert client.connections <= 9
    told = [line for line in lines if line["log_level"] == "error"]
    assert told[0]["robot"] == "chefbot/r1"
    assert "two robots have one serial number" in told[0]["event"]


def test_a_connection_that_held_is_made_again_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A broker that is restarted every two minutes is no other robot."""
    client = FakeClient(holds_s=120.0)
    lines = run(client, monkeypatch, 1205.0)
    assert client.connections == 11
    assert not [line for line in lines if line["log_level"] == "error"]


def test_a_broker_that_is_killed_again_and_again_is_no_other_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is away before it comes back: the pauses begin anew each time."""
    client = FakeClient(holds_s=2.0)
    client.away = 2
    lines = run(client, monkeypatch, 60.0)
    assert len(client.said) >= 12
    assert not [line for line in lines if line["log_level"] == "error"]


def test_a_mistake_of_ours_in_one_message_costs_that_message(monkeypatch: pytest.MonkeyPatch) -> None:
    """The next one is taken, on the same connection."""
    client, taken = FakeClient(), list[bytes]()
    topic = NAME.topic(Kind.ORDER)
    client.listed = [(topic, b"bad"), (topic, b"good")]

    def receive(kind: Kind, data: bytes, retained: bool) -> None:
        if data == b"bad":
            raise KeyError("a mistake")
        taken.append(data)

    run(client, monkeypatch, 10.0, receive)
    assert taken == [b"good"]
    assert client.connections == 1
