"""Encoders that fall silent."""

import pytest

from chefbotd.safety.encoder_timeout import (
    EncoderTimeoutParameters,
    EncoderTimeoutState,
    awaits_echo,
    is_stale,
    may_await_echo,
    note_echo,
    note_reading,
    update,
)
from chefbotd.safety.faults import FaultKind

PARAMETERS = EncoderTimeoutParameters(max_age_s=0.25, latch_after_s=2.0)


@pytest.mark.parametrize(("age_s", "stale"), [(0.0, False), (0.25, False), (0.2501, True), (5.0, True)])
def test_readings_are_stale_past_their_age(age_s: float, stale: bool):
    """The limit itself is still fresh."""
    assert is_stale(PARAMETERS, EncoderTimeoutState(100.0), 100.0 + age_s) is stale


def test_nothing_ever_heard_is_stale():
    """A robot whose encoders never spoke does not move."""
    assert is_stale(PARAMETERS, EncoderTimeoutState(), 0.0)


def test_a_silence_that_interrupts_a_drive_latches_after_two_seconds():
    """The second that the ultrasonic sensor may block is endured; what is longer is a fault that says what to check."""
    state, fault = update(PARAMETERS, EncoderTimeoutState(100.0), 100.3, driven=True)
    assert (state.interrupted, fault) == (True, None)
    state, fault = update(PARAMETERS, state, 102.0, driven=False)
    assert fault is None
    state, fault = update(PARAMETERS, state, 102.01, driven=False)
    assert fault.kind is FaultKind.ENCODERS_SILENT
    assert "no encoder reading for 2.0 s" in fault.reason
    assert not state.interrupted


def test_a_silence_while_standing_never_latches():
    """A board that boots, or that nobody drives, may be silent for as long as it likes."""
    assert update(PARAMETERS, EncoderTimeoutState(100.0), 1000.0, driven=False) == (
        EncoderTimeoutState(100.0),
        None,
    )


def test_a_board_that_said_that_no_echo_came_may_be_silent_for_another_second():
    """Encoders at 10.0, silence, no echo at 11.0, encoders at 11.05: until 12.35 the robot may crawl."""
    state = note_echo(PARAMETERS, note_reading(EncoderTimeoutState(), 10.0), 11.0, is_missing=True)
    state = note_reading(state, 11.05)
    assert awaits_echo(PARAMETERS, state, 11.5)
    assert awaits_echo(PARAMETERS, state, 12.34)
    assert not awaits_echo(PARAMETERS, state, 12.36)
    standing = PARAMETERS.model_copy(update={"silent_speed_m_s": 0.0})
    assert not awaits_echo(standing, state, 11.5)


@pytest.mark.parametrize(
    ("at_s", "is_missing"),
    [
        pytest.param(11.0, False, id="an echo"),
        pytest.param(10.2, True, id="a board that does not wait for it"),
        pytest.param(11.4, True, id="a longer silence than the wait for an echo"),
    ],
)
def test_otherwise_silent_encoders_stop_the_robot_as_ever(at_s: float, is_missing: bool):
    """Encoders at 10.0, and then something else than no echo after a silence of a second."""
    before = EncoderTimeoutState(10.0, awaits_echo=True)
    state = note_reading(note_echo(PARAMETERS, before, at_s, is_missing=is_missing), at_s)
    assert not awaits_echo(PARAMETERS, state, at_s + 0.3)
    assert is_stale(PARAMETERS, state, at_s + 0.3)


def test_lines_that_come_all_at_once_say_the_same_in_another_order():
    """Encoders at 10.0; at 11.0 the next ones come in one read with the "no echo" that was printed before them."""
    state = note_reading(note_reading(EncoderTimeoutState(), 10.0), 11.0)
    state = note_echo(PARAMETERS, state, 11.0, is_missing=True)
    assert awaits_echo(PARAMETERS, state, 12.29)
    assert not awaits_echo(PARAMETERS, note_echo(PARAMETERS, state, 11.0, is_missing=False), 11.5)
    soon = note_reading(note_reading(state, 11.05), 11.1)
    assert not awaits_echo(PARAMETERS, note_echo(PARAMETERS, soon, 11.1, is_missing=True), 11.5)


def test_after_a_missed_echo_a_silence_may_be_another_wait() -> None:
    """For half a minute, and for no longer than the wait takes; a robot without a speed for it stands."""
    state = note_reading(
        note_echo(PARAMETERS, note_reading(EncoderTimeoutState(), 10.0), 11.0, is_missing=True), 11.0
    )
    state = note_reading(note_echo(PARAMETERS, state, 11.05, is_missing=False), 20.0)
    assert may_await_echo(PARAMETERS, state, 21.25)
    assert not may_await_echo(PARAMETERS, state, 21.5)
    assert not may_await_echo(PARAMETERS, note_reading(state, 41.5), 42.0)
    assert not may_await_echo(EncoderTimeoutParameters(silent_speed_m_s=0.0), state, 20.5)


def test_one_reading_does_not_end_a_silence_that_is_a_fault() -> None:
    """1.5 s without readings, one, and 0.6 s more are over 2 s in all, once that silence is no wait for an echo."""
    state, fault = update(PARAMETERS, note_reading(EncoderTimeoutState(), 10.0), 11.4, driven=True)
    assert fault is None
    state, fault = update(PARAMETERS, note_reading(state, 11.5), 12.7, driven=True)
    assert fault is None
    state, fault = update(PARAMETERS, state, 12.85, driven=True)
    assert fault is not None
    assert "no encoder reading for 1.3 s, and shortly before for 1.5 s in all, while" in fault.reason


def test_earlier_silences_fade_while_readings_come() -> None:
    """1.5 s are forgotten after 6 s of readings, and silences that a wait for an echo explains never count."""
    state, _ = update(PARAMETERS, note_reading(EncoderTimeoutState(), 10.0), 11.4, driven=True)
    for count in range(31):
        state = note_reading(state, 11.5 + 0.2 * count)
    assert update(PARAMETERS, state, 17.5 + 1.95, driven=True)[1] is None
    state = note_reading(EncoderTimeoutState(), 10.0)
    for count in range(1, 20):
        state, fault = update(PARAMETERS, state, 10.0 + 1.05 * count - 0.05, driven=True)
        assert fault is None
        state = note_reading(state, 10.0 + 1.05 * count)
