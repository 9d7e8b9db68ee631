"""The gains that follow from the motors' models, and when a duty acts.

The gains are those of lambda tuning for a first-order plant with delay (E. B. Dahlin, "Designing and tuning digital
controllers", Instruments and Control Systems 41, 1968): ``Kc = lag / (gain (lambda + delay))``, ``Ti = lag``.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from statistics import mean, median

from chefbotd.components.calibration.algorithms.motor_fit import DELAY, FittedMotor
from chefbotd.components.calibration.algorithms.step import ConfiguredRobot, Estimate, Measurements
from chefbotd.core.record import Record
from chefbotd.motion.kinematics import Kinematics

LAMBDA_LAGS = 3.0
"""The closed loop's time constant in those of the motor: a robust choice of lambda, and never less than the delay."""


class Timing(Record, frozen=True):
    """When a duty comes into force: ``cycle_s`` is the board's, ``after_s`` from a reading to the echo of its cycle."""

    cycle_s: float
    after_s: float


def timing_of(measured: Measurements) -> Timing | None:
    """The board's cycle, and how long after a reading its cycle's duty is in force; None without echoes."""
    stamps = [event.stamp_s for event in measured.wheels]
    if len(measured.echoed) < 10 or len(stamps) < 10:
        return None
    cycle_s = median([after - before for before, after in pairwise(stamps)])
    afters, place = [], 0
    for echo in measured.echoed:
        while place + 1 < len(stamps) and stamps[place + 1] <= echo.stamp_s:
            place += 1
        if 0 <= echo.stamp_s - stamps[place] < 2 * cycle_s:
            afters.append(echo.stamp_s - stamps[place])
    return Timing(cycle_s, median(afters)) if afters else None


def _delay_s(robot: ConfiguredRobot, motors: Sequence[FittedMotor], timing: Timing | None) -> float:
    """From a reading until the duty that it leads to acts: the board reads it in its next cycle."""
    if timing is None:
        return robot.drive.response_delay_s
    return max(timing.cycle_s + timing.after_s + mean([one.parameters[DELAY] for one in motors]), 0.0)


def lambda_gains(kv_duty_per_m_s: float, lag_s: float, delay_s: float) -> tuple[float, float]:
    """Proportional and integral gain of lambda tuning, for a plant of gain ``1 / kv``."""
    kp = kv_duty_per_m_s * lag_s / (max(LAMBDA_LAGS * lag_s, delay_s) + delay_s)
    return kp, kp / lag_s


def gains_estimates(
    robot: ConfiguredRobot, motors: Sequence[FittedMotor], timing: Timing | None
) -> Iterator[Estimate]:
    """For every wheel the same gains, by the mean of the motors: wheels that answer alike keep the robot straight.

    None for a robot that was measured on blocks: on the floor its motors move another inertia.
    """
    if len(robot.chassis.wheels) > 2:
        return
    radii_m = Kinematics(robot.chassis).radii_m
    kv = mean(
        [
            mean([1 / (one.parameters[0] * radius_m), 1 / (one.parameters[3] * radius_m)])
            for one, radius_m in zip(motors, radii_m, strict=True)
        ]
    )
    lag_s = mean([mean([one.parameters[2], one.parameters[5]]) for one in motors])
    window = robot.encoders.velocity_window - 1
    measuring_s = window * timing.cycle_s / 2 if timing is not None else 0.1
    hold_s = timing.cycle_s / 2 if timing is not None else 0.025
    delay_s = _delay_s(robot, motors, timing) + measuring_s + hold_s
    kp, ki = lambda_gains(kv, lag_s, delay_s)
    gains = list(robot.gains.values())
    share = mean([one.sigmas[0] / one.parameters[0] for one in motors]) + mean(
        [one.sigmas[2] / one.parameters[2] for one in motors]
    )
    is_one = all(one == gains[0] for one in gains)
    for section in ["pid"] if is_one else [f"wheel_pid.{name}" for name in robot.gains]:
        before = gains[0] if is_one else robot.gains[section.partition(".")[2]]
        yield Estimate(f"{section}.kp_duty_per_m_s", "duty/(m/s)", before.kp, kp, kp * share)
        yield Estimate(f"{section}.ki_duty_per_m", "duty/m", before.ki, ki, ki * share)


def supply_and_delay(
    robot: ConfiguredRobot, motors: Sequence[FittedMotor], voltage_v: float | None, timing: Timing | None
) -> Iterator[Estimate]:
    """The battery's voltage meanwhile, and how late the board obeys."""
    if voltage_v is not None:
        before_v = robot.drive.motor_voltage_v or voltage_v
        yield Estimate("drive.motor_voltage_v", "V", before_v, voltage_v, 0.01)
    if timing is not None:
        before_s, delay_s = robot.drive.response_delay_s, _delay_s(robot, motors, timing)
        sigma_s = mean([one.sigmas[DELAY] for one in motors])
        yield Estimate("drive.response_delay_s", "s", before_s, delay_s, max(sigma_s, 0.001))
