"""What a robot gets whose configuration says nothing: what safety depends on changes only on purpose."""

import pytest

from chefbotd.core.parameters import Parameters
from chefbotd.motion.odometry import OdometryParameters
from chefbotd.motion.same_side import SameSideParameters
from chefbotd.safety.battery_monitor import BatteryMonitorParameters
from chefbotd.safety.encoder_timeout import EncoderTimeoutParameters
from chefbotd.safety.gate import SafetyParameters
from chefbotd.safety.guard import GuardParameters
from chefbotd.safety.wheels import WheelWatchParameters

DEFAULTS: list[tuple[Parameters, dict[str, object]]] = [
    (
        GuardParameters(),
        {
            "enabled": True,
            "stop_distance_m": 0.15,
            "deceleration_m_s2": 0.5,
            "reaction_s": 0.1,
            "max_age_s": 0.5,
            "silent_is_obstacle": False,
        },
    ),
    (SafetyParameters(), {"command_timeout_s": 0.5}),
    (BatteryMonitorParameters(), {"critical_s": 5.0, "absent_below_v": 3.0}),
    (EncoderTimeoutParameters(), {"max_age_s": 0.25, "latch_after_s": 2.0}),
    (
        WheelWatchParameters(),
        {
            "driven_duty_share": 0.2,
            "stalled_s": 1.75,
            "turned_rad": 0.1,
            "reversed_rad": 1.0,
            "rolls_on_s": 0.5,
            "forgotten_s": 30.0,
            "jumps": 10.0,
            "forgiven_per_reading": 0.25,
        },
    ),
    (SameSideParameters(), {"memory_s": 0.2, "slack_m": 0.0015, "share": 0.1}),
    (OdometryParameters(), {"travel_variance_m2_per_m": 1e-4, "turn_variance_rad2_per_rad": 3e-4}),
]


@pytest.mark.parametrize(("parameters", "expected"), DEFAULTS, ids=lambda each: type(each).__name__)
def test_the_defaults_are_these(parameters: Parameters, expected: dict[str, object]):
    """Of every section of the configuration that decides when the robot stops, and where it believes to be."""
    assert {name: getattr(parameters, name) for name in expected} == expected
