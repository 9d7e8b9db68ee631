"""The bounded output queue of one client: telemetry is dropped first, and a client that reads nothing is disconnected.

While the transport accepts bytes they go straight to it. When it says that the client is behind, telemetry waits here.
Under the policy ``latest`` an event replaces the older one of its topic, and beyond ``outbox_bytes`` the oldest event is
dropped. Drops are counted, and the client is told as soon as there is room again. Answers always go to the transport:
for a client that is behind only stops are served, and only their answers are dropped beyond twice the buffer, whatever
was written before them.
"""

import asyncio
import itertools
import socket
from collections import Counter, OrderedDict
from collections.abc import Callable

from chefbotd.rpc.encoding import EventPayload
from chefbotd.rpc.models import Dropped
from chefbotd.rpc.parameters import ApiParameters
from chefbotd.transport.framing import describe_drops

FULL_S = 1.0
"""How long a client may read nothing once as many of its requests wait as may."""

LOOKS = 10
"""How often within its timeout a blocked client's progress is looked at: the time counts from its last, to a tenth."""


class Outbox:
    """The output of one client; ``drops`` counts, by topic, what all clients together have lost.

    Answers come encoded already; ``encode_event`` does so with events, and ``encode`` with what the outbox itself has to
    say: ``describe_drops`` makes that, and where it is empty nothing is said.
    ``plain`` is the transport's own socket, where what it holds is not encrypted: an event goes there at once.
    ``give_up`` is called when the client has read nothing for ``timeout_s``, and ends the connection.
    """

    def __init__(
        self,
        transport: asyncio.Transport,
        parameters: ApiParameters,
        drops: Counter[str],
        give_up: Callable[[], None],
        encode: Callable[[bytes], bytes],
        encode_event: Callable[[EventPayload], bytes],
        describe_drops: Callable[[Dropped], bytes] = describe_drops,
        plain: socket.socket | None = None,
    ) -> None:
        self._transport, self._parameters, self._all_drops = transport, parameters, drops
        self._give_up, self._encode, self._describe_drops = give_up, encode, describe_drops
        self._encode_event, self._write = encode_event, transport.write
        self._buffered, self._send = transport.get_write_buffer_size, None if plain is None else plain.send
        self._waiting: OrderedDict[tuple[str, int], bytes] = OrderedDict()
        self._waiting_bytes = 0
        self._order = itertools.count(1)
        self._dropped: Counter[str] = Counter()
        self._watch: asyncio.TimerHandle | None = None
        self._looks_left = LOOKS
        self._unread_bytes = self._late_bytes = 0
        self.timeout_s = parameters.write_timeout_s
        self.blocked = self.closing = False
        transport.set_write_buffer_limits(parameters.write_buffer_bytes, parameters.write_buffer_bytes // 4)

    def reply(self, line: bytes, *, keep: bool = False) -> None:
        """Write an answer at once. For a client that is behind there is room for as much as two buffers more.

        One that is to ``keep`` is written beyond that too: a client has only so many jobs that are answered late.
        """
        if self.closing:
            return
        if self.blocked and not keep:
            if self._late_bytes > 2 * self._parameters.write_buffer_bytes:
                return
            self._late_bytes += len(line)
        self._unread_bytes += len(line)
        self._transport.write(line)

    def write_event(self, payload: EventPayload, latest: bool) -> None:
        """Write an event at once, or keep it by the policy."""
        if self.closing:
            return
        data = self._encode_event(payload)
        if self.blocked:
            self.telemetry(payload.topic, latest, data)
        elif self._send is None or self._buffered():
            self._write(data)
        else:
            self._send_now(self._send, data)

    def _send_now(self, send: Callable[[bytes, int], int], data: bytes) -> None:
        """Hand bytes to the kernel past the transport, which has none; it takes what the kernel does not."""
        try:
            sent = send(data, socket.MSG_DONTWAIT)
        except OSError:  # the kernel's buffer is full, or the client has gone, as the transport will see
            sent = 0
        if sent < len(data):
            self._write(data[sent:])

    def telemetry(self, topic: str, latest: bool, line: bytes) -> None:
        """The same of one that is encoded."""
        if self.closing:
            return
        if not self.blocked:
            self._transport.write(line)
            return
        key = (topic, 0 if latest else next(self._order))
        if key in self._waiting:
            self._drop(key)
        self._waiting[key] = line
        self._waiting_bytes += len(line)
        while self._waiting_bytes > self._parameters.outbox_bytes:
            self._drop(next(iter(self._waiting)))

    def _drop(self, key: tuple[str, int]) -> None:
        self._waiting_bytes -= len(self._waiting.pop(key))
        self._dropped[key[0]] += 1
        self._all_drops[key[0]] += 1

    def hold_back(self) -> None:
        """The client is behind: from now on it has to make progress."""
        self.blocked, self._late_bytes = True, 0
        self._expect_progress(self._parameters.write_timeout_s)

    def shorten_timeout(self) -> None:
        """Nothing more is read from the client until it reads: wait for that only ``FULL_S``."""
        if self.timeout_s > FULL_S:
            self._expect_progress(FULL_S)

    def resume(self) -> None:
        """The client has caught up: tell it what it lost, then send what waited."""
        self.blocked = False
        if self.closing:
            return
        self._stop_watching()
        if self._dropped:
            notice = Dropped(topics=dict(self._dropped), total=self._dropped.total())
            self._dropped.clear()
            message = self._describe_drops(notice)
            if message:
                self._transport.write(self._encode(message))
        while self._waiting and not self.blocked:
            _, line = self._waiting.popitem(last=False)
            self._waiting_bytes -= len(line)
            self._transport.write(line)

    def shut(self) -> None:
        """Accept no more output."""
        self.closing = True
        self._waiting.clear()

    def close(self, goodbye: bytes = b"") -> None:
        """Send what the transport already has, and ``goodbye``; cut off after ``write_timeout_s`` without progress."""
        self.shut()
        if goodbye:
            self._transport.write(goodbye)
        self._transport.close()
        self._expect_progress(self._parameters.write_timeout_s)

    def lost(self) -> None:
        """The connection is gone."""
        self.closing = True
        self._stop_watching()

    def _expect_progress(self, timeout_s: float) -> None:
        self._stop_watching()
        self.timeout_s, self._unread_bytes = timeout_s, self._transport.get_write_buffer_size()
        self._looks_left = LOOKS
        self._look_later()

    def _look_later(self) -> None:
        self._watch = asyncio.get_running_loop().call_later(self.timeout_s / LOOKS, self._check_progress)

    def _check_progress(self) -> None:
        if self._transport.get_write_buffer_size() < self._unread_bytes:
            self._expect_progress(self.timeout_s)
            return
        self._looks_left -= 1
        if self._looks_left:
            self._look_later()
        else:
            self._give_up()

    def _stop_watching(self) -> None:
        if self._watch is not None:
            self._watch.cancel()
            self._watch = None
