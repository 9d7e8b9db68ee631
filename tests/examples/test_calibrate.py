"""A simulated robot that is wrong in everything calibrates itself, and is then what its configuration says."""

from pathlib import Path

import pytest

from chefbotd.clock import run_virtual
from chefbotd.settings import load
from examples.calibrate import calibrate

WITHIN = {
    "left_radius_multiplier": 0.003,
    "right_radius_multiplier": 0.003,
    "track_multiplier": 0.003,
    "mount_x_m": 0.003,
    "mount_y_m": 0.003,
    "mount_yaw_rad": 0.004,
    "dead_zone_duty": 1.5,
    "gain_rad_s_per_duty": 0.02 * 0.04,
    "time_constant_s": 0.015,
    "divider_ratio": 0.02,
}
"""How near to its true value each parameter is to come: two to three times what the benchmark asks of twenty robots."""


@pytest.mark.slow
def test_every_step_passes_and_comes_near_the_truth(tmp_path: Path) -> None:
    """The configuration that is written has the true values, and a square of 1 m ends five times nearer."""
    said: list[str] = []
    done = run_virtual(calibrate(1, tmp_path, said.append, side_m=1.0))
    assert {result.status for result in done.results} == {"passed"}, said
    off = {
        estimate.key: abs(estimate.after - done.true[estimate.key])
        for result in done.results
        for estimate in result.estimates
        if estimate.key in done.true and estimate.key.rpartition(".")[2] in WITHIN
    }
    assert len(off) >= 18
    assert {key: value for key, value in off.items() if value > WITHIN[key.rpartition(".")[2]]} == {}
    for before, after in zip(done.before, done.after, strict=True):
        assert after.distance_m < before.distance_m / 5
        assert after.heading_rad < before.heading_rad / 5
    assert load(done.config).chassis.track_multiplier != 1.0
    assert done.robot_s < 600
