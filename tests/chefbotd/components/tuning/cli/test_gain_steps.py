"""What keys do to gains."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.components.tuning.cli.gain_steps import CAN_BE_OFF, FINE, FIRST_STEP, Gain, step_gain
from chefbotd.components.tuning.cli.tuning_screen import NAMES
from chefbotd.motion.pid import PidParameters
from tests.budget import examples


@pytest.mark.parametrize(
    ("name", "value", "direction", "after"),
    [
        ("kp", 400.0, 1, 440.0),
        ("kp", 440.0, -1, 400.0),
        ("kp", 0.0, 1, 10.0),
        ("kp", 0.0, -1, 0.0),
        ("kp", 1.05, -1, 0.0),  # 0.95 is below a tenth of the first step, 10
        ("kv", 2400.0, 1, 2640.0),
        ("deadband", 0.0123, 1, 0.01353),
        ("back_calculation_s", None, 1, 0.1),
        ("back_calculation_s", None, -1, None),
        ("back_calculation_s", 0.0105, -1, None),
        ("conditional_integration", True, 1, False),
        ("conditional_integration", False, -1, True),
    ],
)
def test_a_step(name: str, value: Gain, direction: int, after: Gain) -> None:
    """Ten per cent up and down again, four digits; the smallest become zero or off, and lead back up."""
    assert step_gain(name, value, direction) == after


def test_a_fine_step() -> None:
    """One per cent, where it was asked for."""
    assert step_gain("ki", 100.0, 1, FINE) == 101.0


@settings(max_examples=examples(100))
@given(st.sampled_from(sorted(FIRST_STEP)), st.floats(1e-9, 1e5), st.sampled_from([1, -1]))
def test_steps_go_where_they_should(name: str, value: float, direction: int) -> None:
    """Up is more and down is less, until down is nothing at all."""
    after = step_gain(name, value, direction)
    if direction > 0 and value > FIRST_STEP[name]:
        assert isinstance(after, float)
        assert after > value
    elif direction < 0:
        assert after is None or after == 0.0 or after < value


def test_every_gain_has_its_step() -> None:
    """The table covers the numbers of the parameters, and knows which of them can be off."""
    fields = PidParameters.model_fields
    assert set(NAMES) == set(fields)
    assert {name for name in fields if fields[name].default is None} == CAN_BE_OFF
