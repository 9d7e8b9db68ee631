"""The simulated infrared sensor: its curve on both sides of the fold, and what its ADC makes of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.components.simulation.sensors import Infrared, InfraredMount, voltage
from chefbotd.components.simulation.world import World
from chefbotd.core.events import AnalogueCounted, RangeStatus
from chefbotd.core.geometry import Pose2D
from chefbotd.sensing import infrared as sensing
from tests.budget import examples

WALL_AT_1_M = World([(1.0, -5.0, 1.0, 5.0)])


def test_the_curve_is_the_data_sheets() -> None:
    """2.75 V at the fold, 2.70 at 0.20 m, 0.40 at 1.50; half-way in 1/d between 0.5 and 1 m: (1.25 + 0.62) / 2 at 2/3 m.

    The points between are 0.60 and 0.80 m, so at 1/d = (1/0.6 + 1/0.8) / 2 it is (1.03 + 0.78) / 2.
    """
    assert [voltage(distance_m) for distance_m in (0.15, 0.20, 1.50)] == pytest.approx([2.75, 2.70, 0.40])
    assert voltage(2 / (1 / 0.6 + 1 / 0.8)) == pytest.approx((1.03 + 0.78) / 2)


def test_before_the_fold_a_near_object_looks_far() -> None:
    """At 0.05 m the sensor gives what 0.48 m does."""
    assert voltage(0.05) == pytest.approx(voltage(0.48), abs=0.01)
    assert voltage(0.0) == 0.5


@settings(max_examples=examples(50))
@given(st.floats(0.21, 1.49))
def test_the_daemon_reads_it_back_within_a_few_percent(distance_m: float) -> None:
    """Sensor and interpretation join the same points by different curves: within 1 % of each other.

    Only next to the fold, where the curve bends from level to steep between 0.20 and 0.30 m, it is 6 %.
    """
    params = sensing.InfraredParameters(setback_m=0.1, median_window=1)
    state = sensing.InfraredState((sensing.InfraredSample(voltage(distance_m), 0.0),), maybe_folded=False)
    _, measured = sensing.interpret(
        params, state, AnalogueCounted(0.02, 0.02, 0, voltage(distance_m) / 3.3 * 4095)
    )
    assert measured.status is RangeStatus.OK
    assert measured.range_m == pytest.approx(distance_m, rel=0.01 if distance_m > 0.3 else 0.06)


def test_a_wall_is_seen_from_where_the_sensor_sits() -> None:
    """Mounted 0.5 m ahead of the axle, a wall 1 m from it is 0.5 m away: 1.25 V of 3.3 are 1551 of 4095."""
    sensor = Infrared(InfraredMount(base_from_sensor=Pose2D(0.5)), WALL_AT_1_M, noise_v=0, rays=1)
    assert sensor.adc_counts(Pose2D(), np.random.default_rng(1)) == 1551


def test_noise_is_seeded_and_the_adc_is_bounded() -> None:
    """The same seed, the same reading; however wild, it stays within 12 bits."""
    sensor = Infrared(InfraredMount(), WALL_AT_1_M, noise_v=1.0)
    first, second = (
        [sensor.adc_counts(Pose2D(), chance) for _ in range(100)]
        for chance in (np.random.default_rng(1), np.random.default_rng(1))
    )
    assert first == second
    assert (min(first), max(first)) == (0, pytest.approx(3500, abs=595))
    assert max(first) <= 4095


def test_nothing_in_sight_is_nearly_no_voltage() -> None:
    """A wall behind the sensor is not in its cone."""
    sensor = Infrared(InfraredMount(), World([(-1.0, -5.0, -1.0, 5.0)]), noise_v=0)
    assert sensor.adc_counts(Pose2D(), np.random.default_rng(1)) <= round(0.25 / 3.3 * 4095)
