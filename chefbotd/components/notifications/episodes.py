"""Decides what is worth a message: one for each episode, in words that are true when it is sent. Pure."""

from typing import Any, Final

from chefbotd.components.notifications.parameters import NoticeKind
from chefbotd.core.events import BatteryLevelStatus, BatteryMeasured, DriveWarned, SafetyChanged
from chefbotd.core.record import Record

NOBODYS_LOSS: Final = frozenset({"asked", "replaced", "earlier_goal", "request_cancelled"})
"""Why goals are cancelled by those who set them."""

FAILED: Final = frozenset({"unreachable", "blocked", "lost", "fault", "cancelled"})
UNDER_WAY: Final = frozenset({"planning", "driving", "recovering"})

NEARER_M: Final = 0.2
"""Coming nearer to the goal by this much is progress."""

LOW_S: Final = 5.0
"""How much longer the battery is low than not before it is told: the motors pull it down for a moment."""

CALM_S: Final = 60.0
"""How much longer it is well than low before it is told again; and for how long a fault or a warning is gone."""


class Notice(Record, frozen=True):
    """A message: what it is about, a heading, a sentence or two, and when that happened."""

    kind: NoticeKind
    title: str
    text: str
    stamp_s: float


class FaultEpisodes:
    """Tells each fault once until it was gone for a minute: a cable that hangs loose is lost and found by the second.

    One that was there at the start is the end of an earlier daemon, and is not told.
    """

    def __init__(self) -> None:
        self._last: tuple[str | None, int] | None = None
        self._seen_s: dict[str, float] = {}

    def take_safety(self, event: SafetyChanged) -> Notice | None:
        """What the gate's change is worth."""
        state, last = (event.fault, event.latch), self._last
        self._last = state
        if last is not None and last[0] is not None:
            self._seen_s[last[0]] = event.stamp_s
        if event.fault is None or last is None or state == last:
            return None
        if event.stamp_s - self._seen_s.get(event.fault, float("-inf")) < CALM_S:
            return None
        return Notice(
            NoticeKind.FAULT,
            "Fault",
            f"It has stopped for a fault: {event.reason} [{event.fault}]",
            event.stamp_s,
        )


class BatteryEpisodes:
    """Tells once that the battery is low, and once that it is critical, until it has been well for a minute."""

    def __init__(self) -> None:
        self._stamp_s: float | None = None
        self._low_s: dict[BatteryLevelStatus, float] = {}
        self._is_told: dict[BatteryLevelStatus, bool] = {}

    def take_battery(self, event: BatteryMeasured) -> Notice | None:
        """What this reading is worth."""
        step_s = 0.0 if self._stamp_s is None else min(max(event.stamp_s - self._stamp_s, 0.0), 1.0)
        self._stamp_s = event.stamp_s
        critical = BatteryLevelStatus.CRITICAL
        is_low = self._is_due(BatteryLevelStatus.LOW, event.status is not BatteryLevelStatus.OK, step_s)
        is_critical = self._is_due(critical, event.status is critical, step_s)
        if not is_low and not is_critical:
            return None
        word = "critically low" if is_critical else "low"
        text = f"The battery is {word}: {event.voltage_v:.1f} V, {max(event.percentage, 0.0):.0f} %."
        return Notice(NoticeKind.BATTERY_LOW, f"Battery {word}", text, event.stamp_s)

    def _is_due(self, level: BatteryLevelStatus, is_below: bool, step_s: float) -> bool:
        """Whether the level is to be told now; the time below it counts up, the time above it down."""
        low_s = self._low_s.get(level, 0.0) + (step_s if is_below else -step_s)
        self._low_s[level] = low_s = min(max(low_s, 0.0), CALM_S)
        if low_s == 0.0:
            self._is_told[level] = False
        elif low_s >= LOW_S and is_below and not self._is_told.get(level, False):
            self._is_told[level], self._low_s[level] = True, CALM_S
            return True
        return False


class GoalEpisodes:
    """Tells how each goal ended, and once for each standstill that a robot under way comes no nearer to its goal."""

    def __init__(self, stuck_after_s: float) -> None:
        self._stuck_after_s = stuck_after_s
        self._ended: int | None = None
        self._goal: int | None = None
        self._nearest_m: float | None = None
        self._since_s: float | None = None
        self._reason = ""
        self._is_told = False

    def take_navigation(self, event: Any) -> Notice | None:
        """What a change of navigation (``NavigationChanged``) is worth."""
        if event.state in UNDER_WAY:
            self._follow(event)
            return None
        self._since_s = None
        if event.goal is None or event.goal == self._ended or event.state not in FAILED | {"reached"}:
            return None
        self._ended = event.goal
        if event.state == "reached":
            return Notice(NoticeKind.GOAL_DONE, "Goal reached", "It has reached its goal.", event.stamp_s)
        if event.state == "cancelled" and (event.cause is None or str(event.cause) in NOBODYS_LOSS):
            return None
        why = f": {event.reason}" if event.reason else ""
        text = f"It has not reached its goal ({event.state}){why}"
        return Notice(NoticeKind.GOAL_FAILED, "Goal not reached", text, event.stamp_s)

    def _follow(self, event: Any) -> None:
        """Note progress: another goal, a start after a pause, or a goal that is nearer than ever."""
        distance_m, self._reason = event.distance_m, event.reason
        is_new = event.goal != self._goal or self._since_s is None
        is_nearer = distance_m is not None and (
            self._nearest_m is None or distance_m < self._nearest_m - NEARER_M
        )
        if is_new or is_nearer:
            self._goal, self._nearest_m, self._since_s = event.goal, distance_m, event.stamp_s
            self._is_told = False

    def check_progress(self, now_s: float) -> Notice | None:
        """Whether it has been stuck for long enough by now."""
        since_s = self._since_s
        if since_s is None or self._is_told or now_s - since_s < self._stuck_after_s:
            return None
        self._is_told = True
        why = f" ({self._reason})" if self._reason else ""
        text = f"It has a goal, and has come no nearer to it for {now_s - since_s:.0f} s{why}."
        return Notice(NoticeKind.STUCK, "Stuck", text, now_s)


class WheelEpisodes:
    """Tells once that wheels do not follow their commands, until they have followed for a minute."""

    def __init__(self) -> None:
        self._is_warned = False
        self._warned_s = float("-inf")

    def take_warning(self, event: DriveWarned) -> Notice | None:
        """What the warning is worth."""
        was_warned, self._is_warned = self._is_warned, bool(event.reason)
        if was_warned:
            self._warned_s = event.stamp_s
        if not event.reason or was_warned or event.stamp_s - self._warned_s < CALM_S:
            return None
        text = f"Its wheels do not follow their commands: {event.reason}"
        return Notice(NoticeKind.STUCK, "Wheels do not follow", text, event.stamp_s)
