"""A few minutes of the soak; `make soak` drives an hour."""

import pytest

from tests.scenarios.soak import soak


@pytest.mark.parametrize("seed", [1, 2])
def test_nothing_breaks_in_three_minutes_of_faults(seed: int):
    """Seeded faults at random: no motion while disarmed, setpoints within limits, odometry near the truth."""
    report = soak(3.0, seed)
    assert report.control_steps > 2000
    assert report.faults.total() > 5
    assert report.travelled_m > 3.0
