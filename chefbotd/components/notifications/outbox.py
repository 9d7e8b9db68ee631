"""The messages that wait for one server, and how the last of them fared."""

import asyncio
import http.client
import secrets
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any, Final

import structlog

from chefbotd.clock import Clock
from chefbotd.components.notifications.delivery import MessageServer, NotTaken, Post
from chefbotd.components.notifications.episodes import Notice
from chefbotd.components.notifications.events import ToldServer
from chefbotd.components.notifications.parameters import NoticeKind
from chefbotd.core.record import replace

log = structlog.get_logger(component="notifications")

QUEUE_LENGTH: Final = 32
FIRST_WAIT_S: Final = 5.0
LONGEST_WAIT_S: Final = 300.0
GIVE_UP_S: Final = 6 * 3600.0
"""An older message is of no use."""

Deliver = Callable[[Post], Awaitable[None]]


class MessageQueue:
    """The messages for one server, sent one after the other, the oldest first; in a full one the oldest gives way.

    ``changed`` is called when there is something new to know of them.
    """

    def __init__(
        self,
        target: MessageServer,
        robot: str,
        clock: Clock,
        send: Deliver,
        wall_s: Callable[[], float] = lambda: 0.0,
        changed: Callable[[], None] = lambda: None,
    ) -> None:
        self._target, self._robot, self._clock, self._send = target, robot, clock, send
        self._wall_s, self._changed = wall_s, changed
        self._notices: deque[tuple[str, Notice]] = deque()
        self._trying: Notice | None = None
        self._is_filled = asyncio.Event()
        self._last: tuple[str, ToldServer] = ("", ToldServer(target.name, target.host))
        self.sent = self.dropped = 0

    def state_of_server(self) -> ToldServer:
        """The server, and how its last message fared."""
        waiting = len(self._notices) + (self._trying is not None)
        return replace(self._last[1], waiting=waiting, sent=self.sent, dropped=self.dropped)

    def is_waiting_with(self, kind: NoticeKind) -> bool:
        """Whether a message of this kind has not been taken yet."""
        waiting = [notice for _, notice in self._notices]
        return any(notice.kind is kind for notice in (*waiting, self._trying) if notice is not None)

    def add_notice(self, notice: Notice) -> None:
        """Have a message sent; never waits."""
        if len(self._notices) == QUEUE_LENGTH:
            self._notices.popleft()
            self.dropped += 1
        number = secrets.token_hex(8)
        self._notices.append((number, notice))
        waits = ToldServer(
            self._target.name, self._target.host, "waits", notice.title, notice.text, self._wall_s()
        )
        self._last = (number, waits)
        self._is_filled.set()
        self._changed()

    async def run(self) -> None:
        """Send until cancelled."""
        while True:
            await self._is_filled.wait()
            number, notice = self._notices.popleft()
            self._trying = notice
            if not self._notices:
                self._is_filled.clear()
            await self._send_notice(number, notice)
            self._trying = None
            self._changed()

    async def _send_notice(self, number: str, notice: Notice) -> None:
        """Try until it is sent, is refused for good, or is too old."""
        wait_s = FIRST_WAIT_S
        while True:
            age_s = max(self._clock.now_s() - notice.stamp_s, 0.0)
            try:
                await self._send(self._target.make_post(notice, self._robot, age_s, number))
            except (OSError, http.client.HTTPException, NotTaken) as error:
                # Words of the error may repeat what the server or the address said; its class and its number do not.
                name = str(error) if isinstance(error, NotTaken) else type(error).__name__
                if (isinstance(error, NotTaken) and not error.again) or age_s + wait_s > GIVE_UP_S:
                    self.dropped += 1
                    self._update(number, state="given_up", problem=name)
                    log.warning(
                        "a message is given up", target=self._target.name, kind=notice.kind, error=name
                    )
                    return
                self._update(number, problem=name)
                if wait_s == FIRST_WAIT_S:
                    log.warning(
                        "a message is not sent, and is tried again", target=self._target.name, error=name
                    )
                await asyncio.sleep(wait_s)
                wait_s = min(2 * wait_s, LONGEST_WAIT_S)
            else:
                self.sent += 1
                self._update(number, state="taken", problem="")
                return

    def _update(self, number: str, **fared: Any) -> None:
        """How a message fared; nobody is told of an older one than the last."""
        if number == self._last[0]:
            self._last = (number, replace(self._last[1], **fared))
            self._changed()
