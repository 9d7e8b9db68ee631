"""One message for each episode, and none for what is none."""

import pytest

from chefbotd.components.navigation.events import GoalCause, NavigationChanged
from chefbotd.components.notifications.episodes import (
    BatteryEpisodes,
    FaultEpisodes,
    GoalEpisodes,
    WheelEpisodes,
)
from chefbotd.components.notifications.parameters import NoticeKind
from chefbotd.core.events import BatteryLevelStatus, BatteryMeasured, DriveWarned, SafetyChanged

STALLED = "the left wheel stands"


def gate(fault: str | None, latch: int, stamp_s: float = 1.0) -> SafetyChanged:
    """The gate, with a fault or without."""
    return SafetyChanged(
        stamp_s, "estop" if fault else "armed", STALLED if fault else "", None, fault, latch=latch
    )


def battery(stamp_s: float, status: BatteryLevelStatus) -> BatteryMeasured:
    """A reading."""
    return BatteryMeasured(11.04, 12.4, status, stamp_s=stamp_s, arrival_s=stamp_s)


def navigation(
    stamp_s: float,
    state: str,
    distance_m: float | None = None,
    reason: str = "",
    cause: GoalCause | None = None,
    goal: int = 7,
) -> NavigationChanged:
    """What navigation says."""
    return NavigationChanged(state, goal, reason, distance_m, None, cause, stamp_s=stamp_s)


def test_a_fault_is_told_once_however_often_the_gate_changes():
    """Twice the same latch is one message; the same fault latched anew after a minute is another."""
    faults = FaultEpisodes()
    states = [gate(None, 0), gate("wheel_stalled", 1), gate("wheel_stalled", 1), gate(None, 1)]
    notices = [faults.take_safety(state) for state in [*states, gate("wheel_stalled", 2, 61.0)]]
    assert [notice is not None for notice in notices] == [False, True, False, False, True]
    assert notices[1] is not None
    assert notices[1].text == "It has stopped for a fault: the left wheel stands [wheel_stalled]"


def test_a_cable_that_hangs_loose_is_one_message_until_it_has_held_for_a_minute():
    """Lost every 4 s for an hour, and found 2 s later; another fault is told, and the loss once more at the end."""
    faults = FaultEpisodes()
    faults.take_safety(gate(None, 0, 0.0))
    told = [
        notice
        for number in range(900)
        for state in (gate("link_lost", number + 1, 4.0 * number), gate(None, number + 1, 4.0 * number + 2.0))
        if (notice := faults.take_safety(state)) is not None
    ]
    assert len(told) == 1
    assert faults.take_safety(gate("wheel_stalled", 901, 3600.0)) is not None
    faults.take_safety(gate(None, 901, 3610.0))
    assert faults.take_safety(gate("link_lost", 902, 3657.0)) is None
    faults.take_safety(gate(None, 902, 3658.0))
    assert faults.take_safety(gate("link_lost", 903, 3718.5)) is not None


def test_a_fault_that_an_earlier_daemon_left_is_not_told_again():
    """It is there in the first state of the gate."""
    assert FaultEpisodes().take_safety(gate("wheel_stalled", 1)) is None


def test_an_emergency_stop_is_no_fault():
    """Somebody pressed it, and knows."""
    faults = FaultEpisodes()
    assert faults.take_safety(gate(None, 0)) is None
    assert faults.take_safety(SafetyChanged(1.0, "estop", "by a client", None, None, latch=1)) is None


def test_a_low_battery_is_told_after_five_seconds_and_again_only_after_a_minute_of_better():
    """At 10 Hz: 5 s low, then flickering for 100 s, then 61 s well, then 5 s low."""
    low, well = BatteryLevelStatus.LOW, BatteryLevelStatus.OK
    statuses = [low] * 52 + [low, well] * 500 + [well] * 610 + [low] * 52
    episodes = BatteryEpisodes()
    notices = [episodes.take_battery(battery(i / 10, status)) for i, status in enumerate(statuses)]
    told = [index for index, notice in enumerate(notices) if notice is not None]
    assert len(told) == 2
    assert told[0] in (50, 51)
    assert told[1] >= 52 + 1000 + 610
    first = notices[told[0]]
    assert first is not None
    assert (first.kind, first.text) == (NoticeKind.BATTERY_LOW, "The battery is low: 11.0 V, 12 %.")


def test_a_battery_that_the_motors_pull_down_for_a_moment_is_not_told():
    """4 s low, 10 s well, again and again."""
    episodes = BatteryEpisodes()
    for index in range(1400):
        status = BatteryLevelStatus.LOW if index % 140 < 40 else BatteryLevelStatus.OK
        assert episodes.take_battery(battery(index / 10, status)) is None


def test_a_battery_that_becomes_critical_is_told_a_second_time():
    """Low and critical are two messages."""
    episodes = BatteryEpisodes()
    statuses = [BatteryLevelStatus.LOW] * 100 + [BatteryLevelStatus.CRITICAL] * 200
    titles = [
        notice.title
        for index, status in enumerate(statuses)
        if (notice := episodes.take_battery(battery(index / 10, status)))
    ]
    assert titles == ["Battery low", "Battery critically low"]


@pytest.mark.parametrize(
    ("state", "cause", "kind"),
    [
        ("reached", None, NoticeKind.GOAL_DONE),
        ("unreachable", None, NoticeKind.GOAL_FAILED),
        ("blocked", None, NoticeKind.GOAL_FAILED),
        ("lost", None, NoticeKind.GOAL_FAILED),
        ("fault", None, NoticeKind.GOAL_FAILED),
        *(
            ("cancelled", cause, NoticeKind.GOAL_FAILED)
            for cause in ("stopped", "worker_lost", "client_left")
        ),
        *(("cancelled", cause, None) for cause in ("asked", "replaced", "earlier_goal", "request_cancelled")),
    ],
)
def test_each_goal_is_told_once_when_it_ends_unless_somebody_cancelled_it(
    state: str, cause: str | None, kind: NoticeKind | None
):
    """The end is repeated on the bus; the message is not."""
    goals, why = GoalEpisodes(60.0), None if cause is None else GoalCause(cause)
    assert goals.take_navigation(navigation(0.0, "driving", 3.0)) is None
    notice = goals.take_navigation(navigation(9.0, state, reason="the door is shut", cause=why))
    assert (notice and notice.kind) == kind
    assert goals.take_navigation(navigation(9.5, state, reason="the door is shut", cause=why)) is None
    if kind is NoticeKind.GOAL_FAILED:
        assert notice is not None
        assert notice.text == f"It has not reached its goal ({state}): the door is shut"


def test_a_robot_that_comes_no_nearer_is_stuck_once_until_it_comes_nearer():
    """Standing for 60 s at 3 m, then 0.5 m nearer, then standing again."""
    goals = GoalEpisodes(60.0)
    goals.take_navigation(navigation(0.0, "driving", 3.0))
    goals.take_navigation(navigation(30.0, "recovering", 3.1, reason="somebody stands in the way"))
    assert goals.check_progress(59.9) is None
    notice = goals.check_progress(60.0)
    assert notice is not None
    assert notice.text == "It has a goal, and has come no nearer to it for 60 s (somebody stands in the way)."
    assert goals.check_progress(300.0) is None
    goals.take_navigation(navigation(310.0, "driving", 2.5))
    assert goals.check_progress(369.0) is None
    assert goals.check_progress(370.0) is not None


@pytest.mark.parametrize("state", ["paused", "reached", "idle"])
def test_a_robot_that_is_not_under_way_is_not_stuck(state: str):
    """However long it stands."""
    goals = GoalEpisodes(60.0)
    goals.take_navigation(navigation(0.0, "driving", 3.0))
    goals.take_navigation(navigation(1.0, state))
    assert goals.check_progress(1000.0) is None


def test_wheels_that_do_not_follow_are_told_once_until_they_do():
    """The reason may change meanwhile, and they may follow for less than a minute."""
    wheels = WheelEpisodes()
    lags = "the left wheel lags"
    warnings = [(1.0, lags), (2.0, "both wheels lag"), (3.0, ""), (62.0, lags), (63.0, ""), (124.0, lags)]
    notices = [wheels.take_warning(DriveWarned(stamp_s, reason)) for stamp_s, reason in warnings]
    assert [notice is not None for notice in notices] == [True, False, False, False, False, True]
