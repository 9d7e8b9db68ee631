"""Numbers and fields on the wire."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_protocol.lines import ADC_12_BIT, INT16, Field, LineKind, Number
from firmware_protocol.messages import BatteryLevel, Reason


@given(st.integers(-(2**15), 2**15 - 1))
def test_a_whole_number_is_written_as_python_writes_it(value: int) -> None:
    """No decimals, no plus, no padding."""
    assert INT16.write(value) == str(value)
    assert INT16.explain(str(value).encode()) is None


@pytest.mark.parametrize("value", [-32769, 32768, 0.5, float("nan")])
def test_a_value_that_does_not_fit_is_named_with_its_range(value: float) -> None:
    """Out of range, a fraction, or not a number at all."""
    with pytest.raises(ValueError, match=f"from -32768 to 32767, got {value}"):
        INT16.write(value)


@pytest.mark.parametrize(
    ("value", "text"), [(0.125, "0.12"), (2.675, "2.67"), (-0.004, "-0.00"), (3, "3.00")]
)
def test_decimals_are_rounded_to_the_field_s_count(value: float, text: str) -> None:
    """Two decimals, nearest to the binary value (0.125 is a tie, to even; 2.675 lies below its tie)."""
    assert Number(-10, 10, decimals=2).write(value) == text


@pytest.mark.parametrize("text", [b"0", b"4095", b"4095.", b".5", b"0.000001", b"-0.00"])
def test_any_number_of_decimals_is_read(text: bytes) -> None:
    """The sketch prints two; other firmware may print more, or none."""
    assert ADC_12_BIT.explain(text) is None


@pytest.mark.parametrize(
    "text", [b"", b".", b"-", b"-.", b"1_0", b"+1", b" 1", b"1 ", b"1e3", b"nan", b"inf", b"1.2.3"]
)
def test_what_python_would_take_or_not_is_no_number(text: bytes) -> None:
    """The wire's numbers are narrower than Python's."""
    refusal = ADC_12_BIT.explain(text)
    assert refusal is not None
    assert refusal[0] is Reason.NOT_A_NUMBER


def test_slots_say_where_each_field_lies_among_the_numbers() -> None:
    """A scalar takes one place, a tuple as many as it has numbers, in the order of the fields."""
    row = LineKind("q", BatteryLevel, (Field("a", INT16), Field("b", INT16, 3), Field("c", INT16)))
    assert row.slots == (0, slice(1, 4), 4)
    assert row.numbers == (INT16,) * 5
