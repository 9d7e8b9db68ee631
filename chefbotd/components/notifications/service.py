"""Sends messages while the daemon runs: events become notices, and each server has a bounded queue of them."""

import asyncio
import http.client
import secrets
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any, Final

import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.notifications.delivery import NotTaken, Post, Target, deliver, targets_of
from chefbotd.components.notifications.episodes import (
    BatteryEpisodes,
    FaultEpisodes,
    GoalEpisodes,
    Notice,
    WheelEpisodes,
)
from chefbotd.components.notifications.parameters import NotificationsParameters
from chefbotd.core.events import BatteryMeasured, DriveWarned, SafetyChanged
from chefbotd.event_classes import class_of
from chefbotd.features.feature import Feature, Service
from chefbotd.metrics import Metrics

log = structlog.get_logger(component="notifications")

QUEUE_LENGTH: Final = 32
FIRST_WAIT_S: Final = 5.0
LONGEST_WAIT_S: Final = 300.0
GIVE_UP_S: Final = 6 * 3600.0
"""An older message is of no use."""

CHECK_EVERY_S: Final = 1.0

Deliver = Callable[[Post], Awaitable[None]]


class Outbox:
    """The messages for one server, sent one after the other, the oldest first; in a full one the oldest gives way."""

    def __init__(self, target: Target, robot: str, clock: Clock, send: Deliver) -> None:
        self._target, self._robot, self._clock, self._send = target, robot, clock, send
        self._notices: deque[tuple[str, Notice]] = deque()
        self._is_filled = asyncio.Event()
        self.sent = self.dropped = 0

    def add_notice(self, notice: Notice) -> None:
        """Have a message sent; never waits."""
        if len(self._notices) == QUEUE_LENGTH:
            self._notices.popleft()
            self.dropped += 1
        self._notices.append((secrets.token_hex(8), notice))
        self._is_filled.set()

    async def run(self) -> None:
        """Send until cancelled."""
        while True:
            await self._is_filled.wait()
            number, notice = self._notices.popleft()
            if not self._notices:
                self._is_filled.clear()
            await self._send_notice(number, notice)

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
                    log.warning(
                        "a message is given up", target=self._target.name, kind=notice.kind, error=name
                    )
                    return
                if wait_s == FIRST_WAIT_S:
                    log.warning(
                        "a message is not sent, and is tried again", target=self._target.name, error=name
                    )
                await asyncio.sleep(wait_s)
                wait_s = min(2 * wait_s, LONGEST_WAIT_S)
            else:
                self.sent += 1
                return


class NotificationService:
    """Watches the bus, and fills the queues of the servers."""

    def __init__(
        self, bus: Bus, clock: Clock, section: NotificationsParameters, robot: str, send: Deliver = deliver
    ) -> None:
        self._clock, self._kinds = clock, frozenset(section.kinds)
        self.outboxes = [Outbox(target, robot, clock, send) for target in targets_of(section)]
        self._goals = GoalEpisodes(section.stuck_after_s)
        self._listen(bus, SafetyChanged, FaultEpisodes().take_safety)
        self._listen(bus, BatteryMeasured, BatteryEpisodes().take_battery)
        self._listen(bus, DriveWarned, WheelEpisodes().take_warning)
        if (navigation := class_of("NavigationChanged")) is not None:
            self._listen(bus, navigation, self._goals.take_navigation)

    def _listen(self, bus: Bus, topic: type[Any], judge: Callable[[Any], Notice | None]) -> None:
        bus.add_handler(lambda event: self._tell(judge(event)), topic)

    def _tell(self, notice: Notice | None) -> None:
        if notice is not None and notice.kind in self._kinds:
            for outbox in self.outboxes:
                outbox.add_notice(notice)

    async def run(self) -> None:
        """Send, and look whether the robot is stuck, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            for outbox in self.outboxes:
                tasks.create_task(outbox.run())
            while True:
                await asyncio.sleep(CHECK_EVERY_S)
                self._tell(self._goals.check_progress(self._clock.now_s()))


def notifications(
    bus: Bus, clock: Clock, section: NotificationsParameters, robot: str, send: Deliver = deliver
) -> Feature:
    """The feature that tells somebody who is away."""
    service = NotificationService(bus, clock, section, robot, send)

    def add_metrics(metrics: Metrics) -> None:
        metrics.counter(
            "notifications_sent",
            "Messages that a server has taken.",
            lambda: sum(o.sent for o in service.outboxes),
        )
        metrics.counter(
            "notifications_dropped",
            "Messages that were given up.",
            lambda: sum(o.dropped for o in service.outboxes),
        )

    return Feature(
        "notifications", services=(Service("notifications", service.run),), add_metrics=add_metrics
    )
