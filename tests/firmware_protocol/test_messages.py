"""Messages are values: immutable, true, and equal to their own kind alone."""

import pytest

from firmware_protocol.messages import BatteryLevel, ResetBoard, ResetDone, UltrasonicDistance


def test_messages_of_two_kinds_with_the_same_numbers_differ() -> None:
    """A distance of 5 cm is no battery reading of 5, and no bare tuple."""
    assert UltrasonicDistance(5) == UltrasonicDistance(5)
    assert UltrasonicDistance(5) != BatteryLevel(5)
    assert not UltrasonicDistance(5) == BatteryLevel(5)  # noqa: SIM201 - the other operator
    assert UltrasonicDistance(5) != (5,)
    assert ResetDone() != ResetBoard()


def test_a_message_without_fields_is_true() -> None:
    """``if message`` asks whether there is one, not whether it has fields."""
    assert ResetDone()
    assert ResetBoard()


def test_a_message_cannot_be_changed() -> None:
    """What many are handed stays what it was."""
    with pytest.raises(AttributeError):
        UltrasonicDistance(5).distance_cm = 6  # type: ignore[misc]
