"""The firmware's benchmark shows figures beside the targets, and a wrong motion as a fault."""

import pytest

from benchmarks import firmware
from tests.firmware import tools

pytestmark = pytest.mark.firmware


def test_all_targets_of_the_core_are_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise, bit errors and a load, with few lines."""
    tools.need("gcc", "make")
    monkeypatch.setattr(firmware, "QUICK_LINES", 20_000)
    parts = (firmware.noise, firmware.bit_errors, firmware.step_of_load)
    outcomes = [part(quick=True) for part in parts]
    assert [outcome.faults for outcome in outcomes] == [(), (), ()]
    assert not [figure for outcome in outcomes for figure in outcome.figures if figure.reached is False]
