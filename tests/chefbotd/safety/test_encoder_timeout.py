"""Encoders that fall silent."""

import pytest

from chefbotd.safety.encoder_timeout import EncoderTimeoutParameters, EncoderTimeoutState, is_stale, update
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
