"""The requests of rosbridge's clients under the daemon's own scheduling: turns, rates, and stops before all others."""

import json
import re
from collections.abc import Callable
from typing import Any

from msgspec import json as msgspec_json

from chefbot_ros2.rosbridge.protocol import ESTOP, Client, read_call
from chefbotd.clock import Clock
from chefbotd.rpc.arrivals import Arrivals, ByteArrival
from chefbotd.rpc.dispatch import Dispatcher
from chefbotd.rpc.encoding import EventPayload
from chefbotd.rpc.jsonrpc import Failure, Request
from chefbotd.rpc.method import Caller
from chefbotd.rpc.models import Dropped
from chefbotd.rpc.session import Session
from chefbotd.transport.web.framing import WebSocketFraming, text_frame

LONGEST_BYTES = 16_384
"""Of a message: a pose with its covariance has 2 kB."""

TOO_LONG = b'{"op":"a message that is too long"}'
VELOCITY_HOLDS_S = 0.5
STOP = re.compile(rb"estop|\\u")
"""Is in every call of the service, however it is escaped."""

STOP_LEFT_OPEN = re.compile(rb'"service"\s*:\s*"/?estop"')
"""In a message that is no JSON: of a call that was mistyped, the stop counts."""


class RosbridgeFraming(WebSocketFraming):
    """Messages of rosbridge: a failure is a status, and nobody is told what it was not sent."""

    def __init__(self) -> None:
        super().__init__(LONGEST_BYTES, TOO_LONG)

    @staticmethod
    def describe_failure(failure: Failure) -> bytes:
        """A status."""
        return msgspec_json.encode({"op": "status", "level": "error", "msg": failure.message})

    @staticmethod
    def describe_drops(dropped: Dropped) -> bytes:
        """Of each topic the newest message follows, so nothing is said."""
        return b""

    def event(self, payload: EventPayload) -> bytes:
        """A message of a topic, which is JSON already."""
        return text_frame(payload.data)


UNKNOWN = "nobody: the bridge did not know of the robot yet"
"""Who is named as having stopped the robot when the bridge hears of its stops for the first time."""


class RosbridgeDispatcher(Dispatcher):
    """``add`` makes a session a client; ``stop_number`` is that of the robot's last stop or fault."""

    sheds = True

    def __init__(self, clock: Clock, arrivals: Arrivals, stop_number: Callable[[], int | None]) -> None:
        super().__init__({}, clock, arrivals, VELOCITY_HOLDS_S)
        self.urgent_pattern = STOP
        self._wall, self._stops, self._robot_stop_number = clock, arrivals, stop_number
        self._clients: dict[Session, Client] = {}

    def add(self, session: Session, client: Client) -> None:
        """A client has come."""
        self._clients[session] = client

    def remove(self, session: Session) -> None:
        """It has gone."""
        self._clients.pop(session, None)

    def serve(self, caller: Caller, line: bytes | bytearray, arrival: ByteArrival | None = None) -> None:
        """Carry out one message, and answer it; a client that sends too many has the rest refused, and stays."""
        client = self._clients.get(caller.session)
        if client is None:
            return
        request = self.urgent_request(caller.session, line)
        if request is not None:
            self.serve_request(caller, request)
        elif caller.session.stops_only:
            client.tell(f"{caller.session.stops_only}: this connection is reserved for the service /estop")
        elif not caller.session.admit_request(self._wall.now_s()):
            client.refuse_excess(bytes(line))
        elif line == TOO_LONG:
            client.tell(f"a message is too long: it has at most {LONGEST_BYTES} bytes")
        else:
            client.commands.stop_number = self._robot_stop_number()
            age_s = 0.0 if arrival is None else self._stops.age_s(arrival)
            client.handle(bytes(line), age_s, self._overtaken_by(arrival))

    def _overtaken_by(self, arrival: ByteArrival | None) -> str:
        if arrival is None or not self._stops.is_before_a_stop(arrival):
            return ""
        if self._stops.stopped_by == UNKNOWN:
            return (
                "it came before anything was known of the robot's stops; send it again if it is still wanted"
            )
        return f"a stop by {self._stops.stopped_by} came before it; send it again if it is still wanted"

    def serve_request(self, caller: Caller, request: Request, arrival: ByteArrival | None = None) -> None:
        """An emergency stop: what others have sent before it moves nothing any more."""
        client = self._clients.get(caller.session)
        if client is not None:
            client.stop(request.params)
        self._stops.record_stop(caller, str(caller.session))

    def urgent_request(self, session: Session, line: bytes | bytearray) -> Request | None:
        """The call of the emergency stop in a message, whatever else is wrong with it; else None."""
        if STOP.search(line) is None:
            return None
        call = read_call(bytes(line)) or self._mistyped_stop(line)
        if call is None or call["service"].removeprefix("/") != ESTOP:
            return None
        return Request(ESTOP, call)

    def _mistyped_stop(self, line: bytes | bytearray) -> dict[str, Any] | None:
        try:
            json.loads(line)
        except (ValueError, RecursionError):
            return {"service": "/estop"} if STOP_LEFT_OPEN.search(line) else None
        return None

    def is_foreign(self, line: bytes | bytearray) -> bool:
        """What came by a WebSocket is of no other protocol."""
        return False

    def shed(self, caller: Caller, lines: bytes) -> None:
        """Refuse messages that are more than may wait."""
        client = self._clients.get(caller.session)
        if client is not None:
            client.refuse_excess(lines.removesuffix(b"\n"))
