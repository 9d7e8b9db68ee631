"""Wheels that turn at another speed than asked for, for seconds."""

from chefbotd.safety import off_target
from chefbotd.safety.off_target import OffTargetParameters, sentence, watch

P = OffTargetParameters()
NAMES = ("left", "right")
FREE_M_S, COUNTS, CYCLE_S = 0.4, 4200.0, 0.25


def told(
    seconds: float, asked_m_s: float, speeds_m_s: tuple[float, float], effort: float
) -> tuple[float | None, str]:
    """When it is told first while wheels turn so, and the last sentence."""
    state, at_s, text = off_target.at_rest(2), None, ""
    for count in range(round(seconds / CYCLE_S)):
        travel_m = (speeds_m_s[0] * CYCLE_S, speeds_m_s[1] * CYCLE_S)
        state = watch(P, state, (asked_m_s,) * 2, (effort,) * 2, travel_m, CYCLE_S, FREE_M_S)
        text = sentence(P, NAMES, state, FREE_M_S, COUNTS)
        if text and at_s is None:
            at_s = (count + 1) * CYCLE_S
    return at_s, text


def test_a_wheel_that_counts_too_little_is_told_with_what_its_duty_gives() -> None:
    """0.1 m/s is asked for, and 0.8 of the duty gives 0.32: 0.05 and 0.1 are said within 3 s."""
    at_s, text = told(4.0, 0.1, (0.05, 0.1), 0.8)
    assert at_s is not None
    assert at_s <= 3.0
    assert text.startswith(
        "left and right turn at 0.05 m/s by the encoders, where 0.10 is asked for; at that duty a free"
    )
    assert "makes about 0.3" in text
    assert "Calibrate the encoders by hand first: the configured 4200 counts" in text


def test_a_wheel_that_turns_faster_than_its_motor_can_is_told_as_such() -> None:
    """At a tenth of the duty a free motor makes 0.04 m/s: 0.16 m/s is not its doing."""
    _, text = told(5.0, 0.1, (0.16, 0.16), 0.1)
    assert text.startswith(
        "left and right turn at 0.16 m/s by the encoders, where 0.10 is asked for; its motor can"
    )


def test_a_wheel_that_is_a_third_off_is_not_told() -> None:
    """Gains may be that bad; so may a carpet."""
    assert told(20.0, 0.1, (0.067, 0.133), 0.4)[0] is None


def test_a_wheel_on_its_target_may_yet_turn_as_its_motor_cannot() -> None:
    """0.2 m/s as asked, at a quarter of the duty, which gives 0.1: the encoder counts more than is configured."""
    at_s, text = told(5.0, 0.2, (0.2, 0.2), 0.25)
    assert at_s is not None
    assert "its motor can make 0.10 at that duty" in text


def test_a_wheel_that_makes_half_of_what_full_duty_gives_is_told() -> None:
    """0.18 of 0.4 m/s, whatever is asked for by then."""
    at_s, text = told(5.0, 0.18, (0.18, 0.18), 1.0)
    assert at_s is not None
    assert "at that duty a free wheel makes about 0.40" in text or "about 0.39" in text


def test_slow_wheels_are_not_judged() -> None:
    """Below 0.04 m/s friction holds a wheel and lets it go."""
    assert told(20.0, 0.03, (0.0, 0.06), 0.2)[0] is None


def test_one_good_mean_does_not_end_it_and_seconds_do() -> None:
    """After 5 s off, a quarter of a second as asked changes nothing; after 6 s of it nothing is told."""
    state = off_target.at_rest(1)
    for _ in range(20):
        state = watch(P, state, (0.1,), (0.5,), (0.05 * CYCLE_S,), CYCLE_S, FREE_M_S)
    state = watch(P, state, (0.1,), (0.5,), (0.1 * CYCLE_S,), CYCLE_S, FREE_M_S)
    assert sentence(P, NAMES, state, FREE_M_S, COUNTS)
    for _ in range(24):
        state = watch(P, state, (0.1,), (0.5,), (0.1 * CYCLE_S,), CYCLE_S, FREE_M_S)
    assert not sentence(P, NAMES, state, FREE_M_S, COUNTS)
