"""The setpoint as the encoders should show it."""

import pytest

from chefbotd.motion.reference import Asked, History, caught_up, mean_m_s, remember

RAMP: History = tuple([Asked(0.02, (0.1 * n, -0.1 * n)) for n in range(1, 6)])
"""0.1 m/s more every 20 ms, up to 0.5 m/s; the other wheel backwards."""


def test_the_mean_is_taken_over_the_measurement_s_own_time():
    """Over 40 ms that ended now: 0.4 and 0.5 m/s, so 0.45; over 40 ms that ended 20 ms ago: 0.3 and 0.4, so 0.35."""
    assert mean_m_s(RAMP, 0.04, 0.0) == pytest.approx((0.45, -0.45))
    assert mean_m_s(RAMP, 0.04, 0.02) == pytest.approx((0.35, -0.35))


def test_a_part_of_a_span_counts_as_a_part():
    """30 ms that ended 10 ms ago are half of 0.5, all of 0.4: (10 ms * 0.5 + 20 ms * 0.4) / 30 ms."""
    assert mean_m_s(RAMP, 0.03, 0.01) == pytest.approx((1.3 / 3, -1.3 / 3))


def test_before_the_first_the_wheels_stood():
    """Over the last 200 ms, of which only 100 ms are known: 20 ms * (0.1 + ... + 0.5) / 200 ms = 0.15 m/s."""
    assert mean_m_s(RAMP, 0.2, 0.0) == pytest.approx((0.15, -0.15))


def test_only_what_reaches_into_the_time_is_remembered():
    """Of 20 ms spans, 50 ms need three: the third reaches over the edge and is kept whole."""
    assert remember(RAMP, Asked(0.02, (0.6, -0.6)), 0.05) == (*RAMP[-2:], Asked(0.02, (0.6, -0.6)))
    assert remember((), Asked(0.02, (0.6, -0.6)), 0.05) == (Asked(0.02, (0.6, -0.6)),)


def test_a_wheel_that_follows_late_is_where_it_should_be():
    """0.3 m/s measured while 0.3 m/s was asked for, 0.5 m/s now: it will be doing 0.5; one that lags by 0.1 is 0.4."""
    assert caught_up((0.3, 0.2), (0.3, 0.3), (0.5, 0.5)) == pytest.approx((0.5, 0.4))


def test_what_just_covers_the_time_is_all_that_is_remembered():
    """Of quarters of a second, half a second needs two: a third that begins where it ends adds nothing."""
    quarters = tuple([Asked(0.25, (0.1 * n, -0.1)) for n in range(3)])
    assert remember(quarters[:2], quarters[2], 0.5) == quarters[1:]


def test_a_setpoint_that_stays_the_same_is_one_entry():
    """Three quarters of a second in all, though half a second is asked for; what was before is cut."""
    quarter, before = Asked(0.25, (0.3, -0.1)), Asked(0.25, (0.2, -0.1))
    history = remember(remember((before, quarter), quarter, 0.5), quarter, 0.5)
    assert history == (Asked(0.75, (0.3, -0.1)),)
    assert mean_m_s(history, 0.4, 0.1) == (0.3, -0.1)
    assert remember((before, quarter), quarter, 0.6) == (before, Asked(0.5, (0.3, -0.1)))


def test_a_steady_history_stays_as_it_is():
    """After ten seconds nothing is counted on; a measurement over a longer time still finds all of it."""
    steady = (Asked(10.0, (0.3, -0.1)),)
    assert remember(steady, Asked(0.02, (0.3, -0.1)), 0.5) is steady
    assert remember(steady, Asked(0.02, (0.3, -0.1)), 12.0) == (Asked(10.02, (0.3, -0.1)),)
