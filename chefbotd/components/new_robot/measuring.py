"""Measures an unknown robot through a daemon of its own, whose configuration assumes nothing of its wheels."""

import asyncio
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractAsyncContextManager

from chefbotd.cli.drive.control import release_source
from chefbotd.client import Client
from chefbotd.components.doctor.cli.collecting import collect_events, of_topic, snapshot
from chefbotd.components.doctor.cli.motors import STANDSTILL_S, turn_wheel
from chefbotd.core.record import Record
from chefbotd.settings import Settings, load, packaged

Connect = Callable[[Settings], AbstractAsyncContextManager[Client]]
"""Runs a daemon with these settings, and yields a client of it."""

UNKNOWN_COUNTS = 1000.0
"""Counts per turn while nobody knows them: only the counts themselves are used then."""

REFERENCE_M_S = 10.0
"""The speed that full duty is called while the motors are unknown: a share of it is that share of the duty."""

RAMP_PER_S, MOST_RAD_S = 4.0, 100.0
"""Full duty is reached within a quarter of a second."""

FASTEST_RAD_S = 10_000.0
"""No reading is refused as impossible while nobody knows how fast the wheels are."""

LOW_SHARE, LOW_S = 0.35, 1.2
FULL_S = 1.6
MEASURED_S = 0.6
"""The speed is the mean over so long at the end of each run: a gear motor's time constant is a tenth of a second."""

LEAST_TURNED_RAD_S = 0.2


def draft(base: str, overrides: Mapping[str, object], counts_per_turn: float | None) -> Settings:
    """A configuration to measure with: what is known of the board, and nothing that refuses an unknown wheel."""
    return load(
        packaged(base),
        overrides={
            "encoders.max_speed_rad_s": FASTEST_RAD_S,
            "encoders.max_acceleration_rad_s2": None,
            "encoders.counts_per_turn": counts_per_turn or UNKNOWN_COUNTS,
            **dict.fromkeys(("imu", "ultrasonic", "battery", "infrared", "lidar", "maps"), False),
            "safety.guard.enabled": False,
            **overrides,
        },
    )


def by_duty(base: str, overrides: Mapping[str, object], counts_per_turn: float) -> Settings:
    """As ``draft``, with controllers that only turn a share of ``REFERENCE_M_S`` into that share of the duty.

    Silent encoders and a late command still stop the motors. A wheel that turns backwards does not: that is what is to
    be found. So nothing here notices a stalled wheel within a run, which is as short as it is for that reason.
    """
    usual = draft(base, overrides, counts_per_turn)
    free = {
        "drive.max_rim_speed_m_s": REFERENCE_M_S,
        "drive.scrub_duty": 0.0,
        "drive.saturation_slowdown_per_s": 0.0,
        "pid.kp_duty_per_m_s": 0.0,
        "pid.ki_duty_per_m": 0.0,
        "pid.kd_duty_per_m_s2": 0.0,
        "pid.ks_duty": 0.0,
        "pid.ka_duty_per_m_s2": 0.0,
        "pid.kv_duty_per_m_s": usual.drive.max_duty / REFERENCE_M_S,
        "pid.output_limit_duty": float(usual.drive.max_duty),
        "limits.linear.max_forward_m_s": REFERENCE_M_S,
        "limits.linear.acceleration_m_s2": RAMP_PER_S * REFERENCE_M_S,
        "limits.angular.max_left_rad_s": MOST_RAD_S,  # one wheel alone turns the robot, as far as odometry knows
        "limits.angular.acceleration_rad_s2": RAMP_PER_S * MOST_RAD_S,
        "safety.wheels.reversed_rad": 100.0,
        "safety.wheels.stalled_s": 60.0,  # also of one that turns backwards; ``run_wheel`` looks before full duty
        "safety.overspeed.margin_m_s": 5.0,  # a wheel that turns backwards is faster that way than asked
        "odometry.source": "wheels",
    }
    return draft(base, {**overrides, **free}, counts_per_turn)


async def count_positions(robot: Client, counts_per_turn: float) -> dict[str, float]:
    """The counts of each wheel since the daemon's start, forward positive."""
    positions = (await snapshot(robot)).position_rad
    return {name: angle / math.tau * counts_per_turn for name, angle in positions.items()}


class WheelSpeeds(Record, frozen=True):
    """One wheel at a low and at full duty: the duties in force, and each wheel's mean speed (rad/s) at each.

    ``refused`` says why the daemon stopped it.
    """

    low_duty: float
    low_rad_s: Mapping[str, float]
    full_duty: float
    full_rad_s: Mapping[str, float]
    refused: str = ""


async def run_wheel(robot: Client, name: str, radius_m: float) -> WheelSpeeds:
    """Turn one wheel forward at a low duty and, if it turned, at full duty. It stands at every exit."""
    try:
        low = await _run(robot, name, LOW_SHARE * REFERENCE_M_S / radius_m, LOW_S)
        turns = abs(low[1].get(name, 0.0)) > LEAST_TURNED_RAD_S
        full = await _run(robot, name, REFERENCE_M_S / radius_m, FULL_S) if turns and not low[2] else low
    finally:
        if robot.connected:
            await release_source(robot)
    await asyncio.sleep(STANDSTILL_S)
    return WheelSpeeds(low[0], low[1], full[0], full[1], low[2] or full[2])


async def _run(
    robot: Client, name: str, speed_rad_s: float, seconds: float
) -> tuple[float, dict[str, float], str]:
    """The last duty of this wheel, each wheel's mean speed at the end, and why it was stopped (empty: it was not)."""
    async with collect_events(robot, ("wheels",)) as events:
        refused = await turn_wheel(robot, name, speed_rad_s, seconds)
        if refused:
            refused = (await robot.get_state()).safety.reason or refused
        readings = [event.data for event in of_topic(events, "wheels")]
        stamps_s = [event.stamp_s for event in of_topic(events, "wheels")]
    late = [
        reading
        for reading, stamp_s in zip(readings, stamps_s, strict=True)
        if stamp_s > stamps_s[-1] - MEASURED_S
    ]
    if not late:
        return 0.0, {}, refused or "no wheels were reported"
    names = late[-1].name
    means = {
        wheel: sum(reading.velocity_rad_s[index] for reading in late) / len(late)
        for index, wheel in enumerate(names)
    }
    return abs(float(late[-1].duty[list(names).index(name)])), means, refused


class MotorFigures(Record, frozen=True):
    """What a robot's motors give: the free rim speed at full duty of its slowest wheel, and the feedforward."""

    free_m_s: float
    free_rad_s: float
    ks_duty: float
    kv_duty_per_m_s: float


def motor_figures(runs: Mapping[str, WheelSpeeds], radius_m: float) -> MotorFigures:
    """The feedforward through both speeds of the wheels; the top speed is that of the slowest wheel."""
    low = _mean([abs(run.low_rad_s[name]) for name, run in runs.items()]) * radius_m
    full = _mean([abs(run.full_rad_s[name]) for name, run in runs.items()]) * radius_m
    low_duty = _mean([run.low_duty for run in runs.values()])
    full_duty = _mean([run.full_duty for run in runs.values()])
    kv = (full_duty - low_duty) / (full - low) if full > low > 0 else full_duty / full
    ks = min(max(full_duty - kv * full, 0.0), 0.5 * full_duty)
    slowest_rad_s = min(abs(run.full_rad_s[name]) for name, run in runs.items())
    return MotorFigures(slowest_rad_s * radius_m, slowest_rad_s, ks, kv)


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)
