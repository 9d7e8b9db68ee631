"""Sends messages while the daemon runs: events become notices, and each server has a bounded queue of them."""

import asyncio
import time
from collections.abc import Callable
from typing import Any, Final

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.notifications.delivery import deliver, targets_of
from chefbotd.components.notifications.episodes import (
    BatteryEpisodes,
    FaultEpisodes,
    GoalEpisodes,
    Notice,
    WheelEpisodes,
)
from chefbotd.components.notifications.events import NotificationsChanged, NotificationsData
from chefbotd.components.notifications.outbox import Deliver, MessageQueue
from chefbotd.components.notifications.parameters import NoticeKind, NotificationsParameters
from chefbotd.core.events import BatteryMeasured, DriveWarned, SafetyChanged
from chefbotd.event_classes import class_of
from chefbotd.features.feature import Feature, Service
from chefbotd.metrics import Metrics
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import DONE, Done, NoParams
from chefbotd.rpc.parameters import Role
from chefbotd.rpc.topics import Topic, same_names

CHECK_EVERY_S: Final = 1.0


class NotificationService:
    """Watches the bus, and fills the queues of the servers."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        section: NotificationsParameters,
        robot: str,
        send: Deliver = deliver,
        wall_s: Callable[[], float] = time.time,
    ) -> None:
        self._bus, self._clock, self._kinds = bus, clock, section.kinds
        self.outboxes = [
            MessageQueue(target, robot, clock, send, wall_s, self._publish) for target in targets_of(section)
        ]
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

    def _publish(self) -> None:
        kinds = tuple(str(kind) for kind in self._kinds)
        servers = tuple(outbox.state_of_server() for outbox in self.outboxes)
        self._bus.publish(NotificationsChanged(kinds, servers, stamp_s=self._clock.now_s()))

    @method(role=Role.ADMIN, moves=False)
    def send_test_notification(self, caller: Caller, params: NoParams) -> Done:
        """Send a message to every server, to try it; none to one for which such a message is still waiting."""
        notice = Notice(NoticeKind.TEST, "Test", "This is a test of its notifications.", self._clock.now_s())
        for outbox in self.outboxes:
            if not outbox.is_waiting_with(NoticeKind.TEST):
                outbox.add_notice(notice)
        return DONE

    async def run(self) -> None:
        """Send, and look whether the robot is stuck, until cancelled."""
        self._publish()
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
        "notifications",
        services=(Service("notifications", service.run),),
        methods=(rows := methods_of(service)),
        topics=(
            Topic("notifications", (NotificationsChanged,), NotificationsData, same_names(NotificationsData)),
        ),
        add_metrics=add_metrics,
        not_replayed=tuple(row.name for row in rows),
    )
