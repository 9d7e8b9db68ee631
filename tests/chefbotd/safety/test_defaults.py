"""What a robot gets whose configuration says nothing: what safety depends on changes only on purpose."""

import pytest

from chefbotd.core.parameters import Parameters
from chefbotd.motion.edge_speed import QuadratureParameters
from chefbotd.motion.encoder import EncoderParameters
from chefbotd.motion.odometry import OdometryParameters
from chefbotd.motion.pid import PidParameters
from chefbotd.motion.same_side import SameSideParameters
from chefbotd.safety.battery_monitor import BatteryMonitorParameters
from chefbotd.safety.echo import EchoParameters
from chefbotd.safety.encoder_timeout import EncoderTimeoutParameters
from chefbotd.safety.gate import SafetyParameters, SourceParameters
from chefbotd.safety.guard import GuardParameters, ScanGuardParameters
from chefbotd.safety.overspeed import OverspeedParameters
from chefbotd.safety.unresponsive import UnresponsiveParameters
from chefbotd.safety.wheels import WheelWatchParameters
from chefbotd.sensing.infrared import InfraredParameters
from chefbotd.sensing.ultrasonic import UltrasonicParameters

DEFAULTS: list[tuple[Parameters, dict[str, object]]] = [
    (
        GuardParameters(),
        {
            "enabled": True,
            "stop_distance_m": 0.15,
            "deceleration_m_s2": 0.5,
            "reaction_s": 0.1,
            "hysteresis_m": 0.02,
            "max_age_s": 0.5,
            "silent_is_obstacle": False,
        },
    ),
    (
        ScanGuardParameters(),
        {
            "stop_distance_m": 0.05,
            "clearance_m": 0.02,
            "turn_deceleration_rad_s2": 1.0,
            "silent_speed_m_s": 0.1,
        },
    ),
    (
        SafetyParameters(),
        {
            "command_timeout_s": 0.5,
            "stop_hold_s": 1.0,
            "rearm": "manual",
            "sources": {
                "safety": SourceParameters(priority=10, timeout_s=0.2),
                "teleop": SourceParameters(priority=7, timeout_s=1.0),
                "calibration": SourceParameters(priority=6, timeout_s=0.5),
                "navigation": SourceParameters(priority=5, timeout_s=1.0),
            },
        },
    ),
    (
        OverspeedParameters(),
        {
            "share": 0.15,
            "margin_m_s": 0.04,
            "braking_m_s2": 0.75,
            "excess_m": 0.015,
            "duration_s": 0.1,
            "stamp_error_s": 0.05,
        },
    ),
    (
        UnresponsiveParameters(),
        {
            "reaction_s": 0.25,
            "readings": 3,
            "braking_m_s2": 0.5,
            "tolerance_m": 0.03,
            "rest_m_s": 0.005,
            "rest_s": 0.2,
        },
    ),
    (EchoParameters(), {"mismatches": 8.0, "decay_per_match": 0.5, "min_confirmations": 5, "memory_s": 3.0}),
    (BatteryMonitorParameters(), {"critical_s": 5.0, "absent_below_v": 3.0}),
    (EncoderTimeoutParameters(), {"max_age_s": 0.25, "latch_after_s": 2.0, "silent_speed_m_s": 0.06}),
    (
        WheelWatchParameters(),
        {
            "driven_duty_share": 0.2,
            "stalled_s": 1.75,
            "turned_rad": 0.1,
            "reversed_rad": 1.0,
            "coast_s": 0.5,
            "decay_s": 30.0,
            "jumps": 10.0,
            "decay_per_reading": 0.25,
        },
    ),
    (SameSideParameters(), {"memory_s": 0.2, "tolerance_m": 0.0015, "share": 0.1}),
    (OdometryParameters(), {"travel_variance_m2_per_m": 1e-4, "turn_variance_rad2_per_rad": 3e-4}),
    (
        EncoderParameters(counts_per_turn=4200, max_speed_rad_s=9.0),
        {
            "width_bits": 32,
            "tolerance_counts": 4,
            "velocity_window": 5,
            "standstill_rad_s": 0.0,
            "confirmations": 3,
            "max_acceleration_rad_s2": None,
        },
    ),
    (QuadratureParameters(), {"window_s": 0.04, "standstill_s": 5.0}),
    (
        PidParameters(kp_duty_per_m_s=400.0, ki_duty_per_m=100.0, output_limit_duty=255.0),
        {
            "kd": 0.0,
            "ks": 0.0,
            "kv": 0.0,
            "ka": 0.0,
            "integral_limit": None,
            "deadband": 0.0,
            "derivative_filter_s": 0.0,
            "back_calculation_s": None,
            "conditional_integration": True,
        },
    ),
    (
        UltrasonicParameters(),
        {
            "min_range_m": 0.02,
            "max_range_m": 4.0,
            "field_of_view_rad": 0.26,
            "mount_x_m": 0.0,
            "mount_y_m": 0.0,
            "mount_heading_rad": 0.0,
        },
    ),
    (
        InfraredParameters(setback_m=0.1),
        {
            "channel": 0,
            "reference_v": 3.3,
            "max_gap_s": 0.1,
            "median_window": 5,
            "min_range_m": 0.2,
            "max_range_m": 1.5,
            "field_of_view_rad": 0.1,
            "mount_x_m": 0.0,
            "mount_y_m": 0.0,
            "mount_heading_rad": 0.0,
        },
    ),
]


@pytest.mark.parametrize(("parameters", "expected"), DEFAULTS, ids=lambda each: type(each).__name__)
def test_the_defaults_are_these(parameters: Parameters, expected: dict[str, object]):
    """Of every section of the configuration that decides when the robot stops, and where it believes to be."""
    assert {name: getattr(parameters, name) for name in expected} == expected
