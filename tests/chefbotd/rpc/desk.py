"""One who asks the dispatcher, without a connection."""

import json
from typing import Any

from chefbotd.clock import ManualClock
from chefbotd.rpc import jsonrpc
from chefbotd.rpc.arrivals import Arrivals
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.encoding import EventPayload
from chefbotd.rpc.fanout import Fanout
from chefbotd.rpc.jsonrpc import Failure
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.rpc.session import Session
from chefbotd.rpc.topics import Topic
from tests.fakes.robot import FakeRobot, table_of, topics_of


class Desk:
    """A caller at the dispatcher's desk: asks, and keeps what it is told."""

    def __init__(self, robot: FakeRobot | None = None) -> None:
        self.robot, self.clock = robot or FakeRobot(), ManualClock(100.0)
        self.fanout = Fanout(topics_of(simulated=False), self.clock, self._demand)
        leases = self.robot.leases(self.fanout.publish)
        self.arrivals = Arrivals(self.clock)
        methods = table_of(self.robot, self.fanout, self.clock, leases)
        self.dispatcher = Dispatcher(methods, self.clock, self.arrivals, 0.5)
        self.session = Session(ApiParameters(), "127.0.0.1", 50000, Role.ADMIN, 100.0)
        self.ended: list[Failure] = []
        self.heard: list[dict[str, Any]] = []

    def _demand(self, topic: Topic, wanted: bool) -> None:
        """No topic here is made on demand."""

    def reply(self, line: bytes) -> None:
        """An answer."""
        self.heard.append(json.loads(line))

    def send_event(self, payload: EventPayload, latest: bool) -> None:
        """An event."""
        self.heard.append(json.loads(jsonrpc.event(payload)))

    def end(self, failure: Failure) -> None:
        """The error; then the connection would be closed."""
        self.ended.append(failure)
        self.reply(jsonrpc.error(failure))

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """A request's answer, and nothing else."""
        self.heard.clear()
        line = json.dumps({"jsonrpc": "2.0", "id": 1, "method": method, "params": params})
        self.dispatcher.serve(self, line.encode())
        return self.heard[0]

    def kind(self, method: str, **params: Any) -> str:
        """The kind of error that a request is answered with."""
        kind: str = self.ask(method, **params)["error"]["data"]["kind"]
        return kind
