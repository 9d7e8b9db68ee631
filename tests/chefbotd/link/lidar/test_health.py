"""What is said of a lidar by what has been heard of it."""

import pytest

from chefbotd.link.lidar.health import LidarCondition, LidarHealthWatch, LidarTotals


def said(turn_every_s: float, repeated_every_s: float) -> set[LidarCondition]:
    """All that is said in a minute, but for the first 3 s, of a lidar with a new turn, and an old one, so often."""
    watch, conditions = LidarHealthWatch(0.0, LidarTotals()), set[LidarCondition]()
    for step in range(1, 600):
        now_s = 0.1 * step
        turns, repeated = int(now_s / turn_every_s + 1e-6), int(now_s / repeated_every_s + 1e-6)
        heard = LidarTotals(3000 * step, 30 * step, turns, repeated, now_s)
        health = watch.look(now_s, heard, b"T", "")
        if health is not None and (now_s > 3.0 or health.condition is not LidarCondition.HEALTHY):
            conditions.add(health.condition)
    return conditions


@pytest.mark.parametrize(
    ("turn_every_s", "repeated_every_s", "condition"),
    [(3.0, 0.1, LidarCondition.FROZEN), (8.0, 100.0, LidarCondition.MOTOR_STALLED)],
)
def test_one_good_turn_among_many_makes_no_lidar_healthy(
    turn_every_s: float, repeated_every_s: float, condition: LidarCondition
) -> None:
    """One new turn in thirty, or a turn in 8 s where a lidar makes ten a second: the same is said all the time."""
    assert said(turn_every_s, repeated_every_s) == {condition}


@pytest.mark.parametrize("turn_every_s", [0.1, 0.2, 0.5])
def test_a_lidar_that_turns_is_healthy(turn_every_s: float) -> None:
    """At 10, 5 and 2 turns a second nothing else is said."""
    assert said(turn_every_s, 5.0) == set()
