"""What a valid configuration leaves out, in sentences."""

import pytest

from chefbotd.settings import load, packaged
from chefbotd.settings.notes import guard_warning, notes

OFF = {"safety.guard.enabled": False}


@pytest.mark.parametrize(
    ("robot", "named"),
    [
        ("chefbot", ["an ultrasonic (front)"]),
        ("khan", ["an infrared sensor (front)"]),
        ("chefbot_lidar", ["a lidar (lidar)", "an ultrasonic (front)"]),
    ],
)
def test_a_guard_that_is_off_is_told_with_what_sees(robot: str, named: list[str]) -> None:
    """Each kind of sensor by its name, and what to do; nothing is said of a guard that is on."""
    told = guard_warning(load(packaged(robot), overrides=OFF))
    assert all(name in told for name in named)
    assert "and the guard is off" in told
    assert "delete enabled = false" in told
    assert guard_warning(load(packaged(robot))) == ""


def test_a_lidar_without_a_body_is_told() -> None:
    """Guard and navigation take their outline from it; a robot without a lidar needs none."""
    without = load(packaged("chefbot_lidar")).model_copy(update={"body": None})
    assert any("[body]" in note for note in notes(without))
    assert list(notes(load(packaged("chefbot_lidar")))) == []
    assert list(notes(load(packaged("chefbot")).model_copy(update={"body": None}))) == []
