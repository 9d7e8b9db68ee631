"""The loop of a wheel that is not believed, and of the mate that is."""

import pytest

from chefbotd.motion.same_side import loop_speeds, substitute_readings

LED = ((2, 0),)
"""Rear left is driven like front left."""


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("believed_m_s", "led_m_s", "loop_m_s"),
    [
        (0.2, 0.0, 0.2),  # a dead encoder, and the mate that is right
        (0.4, 0.0, 0.4),  # the mate overshoots: it is braked
        (0.0, 0.2, 0.2),  # the choice was wrong: the side does not stand
        (0.0, 0.5, 0.3),  # and is not driven any further, however fast it already is
        (0.3, 0.7, 0.3),  # a slipping wheel does not brake its mate
        (0.4, 0.7, 0.4),
        (-0.1, 0.0, 0.0),  # one rolls on after a change of direction, one stands
    ],
)  # fmt: skip
def test_a_side_is_never_driven_past_its_target_by_a_reading_too_small(
    sign: float, believed_m_s: float, led_m_s: float, loop_m_s: float
):
    """Asked for 0.3 m/s either way, both loops hear the same, and the other side's wheels are not concerned."""
    speeds_m_s = (sign * believed_m_s, 0.1, sign * led_m_s, -0.1)
    expected = pytest.approx((sign * loop_m_s, 0.1, sign * loop_m_s, -0.1))
    assert loop_speeds(LED, speeds_m_s, (sign * 0.3, 0.1, sign * 0.3, 0.1)) == expected


def test_of_two_that_are_led_the_faster_counts():
    """Of three wheels of a side, one at 0.1 and one at 0.2 m/s, the substitute's loop hears the 0.2."""
    assert loop_speeds(((1, 0), (2, 0)), (0.0, 0.2, 0.1), (0.3, 0.3, 0.3)) == (0.2, 0.2, 0.2)


def test_a_wheel_that_is_led_has_what_its_leader_has():
    """Nobody else's changes."""
    assert substitute_readings(LED, "abcd") == ("a", "b", "a", "d")
