"""The result of the step ``motors``: the models of all wheels, and the gains that follow.

The gains are those of lambda tuning for a first-order plant with delay (E. B. Dahlin, "Designing and tuning digital
controllers", Instruments and Control Systems 41, 1968): ``Kc = lag / (gain (lambda + delay))``, ``Ti = lag``.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from statistics import mean, median

from chefbotd.calibration.motor_fit import DELAY, Fitted, Input, Run, Sample, fit, simulated
from chefbotd.calibration.motor_wiring import wrong_wiring
from chefbotd.calibration.step import (
    Estimate,
    Measurements,
    Plot,
    Residual,
    Robot,
    Series,
    Status,
    StepResult,
)
from chefbotd.core.record import Record
from chefbotd.motion.kinematics import Kinematics
from chefbotd.motion.motor_model import MotorModel

NAME = "motors"
HANGS_FREE = "hangs_free"
"""The key of a question: a robot that skids when it turns is calibrated on blocks."""

LEAST_STRETCHES = 8
MOST_RESIDUAL_RAD = 0.1
"""A model that leaves more of the angle unexplained, in the mean of a stretch, is none of this motor."""

MOST_GAIN_SHARE, MOST_DEAD_ZONE_SHARE, MOST_LAG_S = 0.05, 0.015, 0.03
"""Standard deviations of a usable result: of the gain, of the full duty, and in seconds."""

LAMBDA_LAGS = 3.0
"""The closed loop's time constant in those of the motor: a robust choice of lambda, and never less than the delay."""

PLOTTED_S = 2.4

PARAMETERS = (("gain_rad_s_per_duty", "rad/s"), ("dead_zone_duty", "duty"), ("time_constant_s", "s"))


class _Timing(Record, frozen=True):
    """When a duty comes into force: ``cycle_s`` is the board's, ``after_s`` from a reading to the echo of its cycle."""

    cycle_s: float
    after_s: float


def fit_motors(robot: Robot, measured: Measurements) -> StepResult:
    """The models of all wheels, and the gains that follow."""
    if measured.answers.get(HANGS_FREE, 1.0) < 1.0:
        return _not_enough(
            "a robot with more than two wheels is calibrated on blocks, where all wheels hang free"
        )
    if len(measured.driven) < 10 or len(measured.wheels) < 10:
        return _not_enough("there are no readings of driven wheels")
    if wrong := wrong_wiring(robot, measured):
        return StepResult(NAME, Status.REFUSED, wrong)
    voltage_v = mean([event.voltage_v for event in measured.battery]) if measured.battery else None
    motors: list[Fitted] = []
    wheel_runs: list[tuple[Run, ...]] = []
    for number, wheel in enumerate(robot.chassis.wheels):
        runs = _runs(robot, measured, number, voltage_v)
        stretches = sum(len(run.inputs) - 1 for run in runs)
        if stretches < LEAST_STRETCHES:
            return _not_enough(f"{wheel.name} was driven at {stretches} duties, {LEAST_STRETCHES} are needed")
        fitted = fit(runs, _start(robot, number))
        if fitted is None:
            return _not_enough(f"the drive does not determine the motor of {wheel.name} in both directions")
        if why := _unbelievable(robot, wheel.name, fitted):
            return StepResult(NAME, Status.REFUSED, why, residuals=(_residual(wheel.name, fitted),))
        motors.append(fitted)
        wheel_runs.append(runs)
    timing = _timing(measured)
    estimates = [
        *_models(robot, motors),
        *_gains(robot, motors, timing),
        *_others(robot, motors, voltage_v, timing),
    ]
    names = [wheel.name for wheel in robot.chassis.wheels]
    plots = [
        _plot(name, runs, _start(robot, number), fitted.parameters)
        for number, (name, runs, fitted) in enumerate(zip(names, wheel_runs, motors, strict=True))
    ]
    residuals = tuple(_residual(name, fitted) for name, fitted in zip(names, motors, strict=True))
    return StepResult(
        NAME, Status.PASSED, _remark(robot, measured), tuple(estimates), residuals, tuple(plots)
    )


def _not_enough(why: str) -> StepResult:
    return StepResult(NAME, Status.NOT_ENOUGH, why)


def _start(robot: Robot, number: int) -> tuple[float, ...]:
    """The parameters as they are configured: by the motors' models, else by the feedforward."""
    wheel, radius_m = robot.chassis.wheels[number], Kinematics(robot.chassis).radii_m[number]
    if (motor := robot.drive.motors.get(wheel.name)) is not None:
        return (*_values(motor.forward), *_values(motor.reverse), 0.0, 1.0)
    gains = robot.gains[wheel.name]
    kv = gains.kv or robot.drive.max_duty / robot.drive.max_rim_speed_m_s
    one_way = (1 / (kv * radius_m), gains.ks, max(gains.ka / kv, 0.01))
    return (*one_way, *one_way, 0.0, 1.0)


def _values(model: MotorModel) -> tuple[float, float, float]:
    return model.gain_rad_s_per_duty, model.dead_zone_duty, model.time_constant_s


def _changes(robot: Robot, measured: Measurements) -> Iterator[tuple[float, tuple[float, ...]]]:
    """When which duties came into force (forward positive): by the board's echo, else by the steps before them."""
    signs = [wheel.motor_sign for wheel in robot.chassis.wheels]
    before: tuple[float, ...] = ()
    for event in measured.echoed or measured.driven:
        duty = tuple([value * sign for value, sign in zip(event.duty, signs, strict=True)])
        if duty != before:
            before = duty
            yield event.stamp_s, duty


def _runs(robot: Robot, measured: Measurements, number: int, voltage_v: float | None) -> tuple[Run, ...]:
    """The drives of all wheels from rest; those of one wheel alone are left out."""
    runs: list[Run] = []
    inside: list[Input] = []
    spins = is_whole = False
    for stamp_s, duty in _changes(robot, measured):
        if not inside:
            is_whole, spins = True, min(duty) < 0 < max(duty)
        inside.append(Input(stamp_s, duty[number]))
        is_whole = is_whole and (all(duty) or not any(duty))
        if not any(duty):
            if is_whole and len(inside) > 1:
                runs.append(_run(measured, number, inside, voltage_v, spins=spins))
            inside = []
    return tuple(run for run in runs if len(run.samples) > 1)


BEFORE_S = 0.3
"""A run begins with the readings of so long before it: one of them is the angle at rest."""


def _run(
    measured: Measurements, number: int, inputs: Sequence[Input], voltage_v: float | None, *, spins: bool
) -> Run:
    begin_s, end_s = inputs[0].stamp_s, inputs[-1].stamp_s
    samples = [
        Sample(event.stamp_s, event.position_rad[number])
        for event in measured.wheels
        if begin_s - BEFORE_S <= event.stamp_s <= end_s
    ]
    supplied = [
        Input(entry.stamp_s, entry.duty * _supply(measured, entry.stamp_s, after.stamp_s, voltage_v))
        for entry, after in pairwise(inputs)
    ]
    return Run(spins, (*supplied, inputs[-1]), tuple(samples))


def _supply(measured: Measurements, from_s: float, to_s: float, voltage_v: float | None) -> float:
    """The battery's voltage over a stretch, as a share of the mean."""
    inside = [event.voltage_v for event in measured.battery if from_s <= event.stamp_s < to_s]
    return mean(inside) / voltage_v if inside and voltage_v else 1.0


def _unbelievable(robot: Robot, name: str, fitted: Fitted) -> str:
    """Why this is no result; empty: it is one."""
    if fitted.after_rad > MOST_RESIDUAL_RAD:
        return (
            f"no motor turns as {name} did: the model is {fitted.after_rad:.2f} rad off; does the wheel slip, is it "
            "blocked, or is its encoder loose?"
        )
    full = robot.drive.max_duty
    for first, direction in ((0, "forward"), (3, "reverse")):
        gain, dead_zone, lag_s = fitted.parameters[first : first + 3]
        gain_sigma, dead_zone_sigma, lag_sigma_s = fitted.sigmas[first : first + 3]
        if dead_zone > full / 2 or gain <= 1e-4 or lag_s <= 0.006:
            return (
                f"{name} {direction}: a dead zone of {dead_zone:.0f}, a gain of {gain:.4f} rad/s and a time constant "
                f"of {lag_s:.3f} s are those of no motor"
            )
        if (
            gain_sigma > MOST_GAIN_SHARE * gain
            or dead_zone_sigma > MOST_DEAD_ZONE_SHARE * full
            or lag_sigma_s > MOST_LAG_S
        ):
            return (
                f"{name} {direction} turned too irregularly: the standard deviations are {gain_sigma / gain:.1%} of the "
                f"gain, {dead_zone_sigma:.1f} of the dead zone, {lag_sigma_s * 1e3:.0f} ms of the time constant"
            )
    return ""


def _residual(name: str, fitted: Fitted) -> Residual:
    return Residual(f"angle of {name}", "rad", fitted.before_rad, fitted.after_rad, fitted.count)


def _models(robot: Robot, motors: Sequence[Fitted]) -> Iterator[Estimate]:
    for number, (wheel, fitted) in enumerate(zip(robot.chassis.wheels, motors, strict=True)):
        start = _start(robot, number)
        for first, direction in ((0, "forward"), (3, "reverse")):
            for place, (key, unit) in enumerate(PARAMETERS, first):
                yield Estimate(
                    f"drive.motors.{wheel.name}.{direction}.{key}",
                    unit,
                    start[place],
                    fitted.parameters[place],
                    fitted.sigmas[place],
                )


def _timing(measured: Measurements) -> _Timing | None:
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
    return _Timing(cycle_s, median(afters)) if afters else None


def _delay_s(robot: Robot, motors: Sequence[Fitted], timing: _Timing | None) -> float:
    """From a reading until the duty that it leads to acts: the board reads it in its next cycle."""
    if timing is None:
        return robot.drive.response_delay_s
    return max(timing.cycle_s + timing.after_s + mean([one.parameters[DELAY] for one in motors]), 0.0)


def lambda_gains(kv_duty_per_m_s: float, lag_s: float, delay_s: float) -> tuple[float, float]:
    """Proportional and integral gain of lambda tuning, for a plant of gain ``1 / kv``."""
    kp = kv_duty_per_m_s * lag_s / (max(LAMBDA_LAGS * lag_s, delay_s) + delay_s)
    return kp, kp / lag_s


def _gains(robot: Robot, motors: Sequence[Fitted], timing: _Timing | None) -> Iterator[Estimate]:
    """For every wheel the same gains, by the mean of the motors: wheels that answer alike keep the robot straight."""
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


def _others(
    robot: Robot, motors: Sequence[Fitted], voltage_v: float | None, timing: _Timing | None
) -> Iterator[Estimate]:
    if voltage_v is not None:
        before_v = robot.drive.motor_voltage_v or voltage_v
        yield Estimate("drive.motor_voltage_v", "V", before_v, voltage_v, 0.01)
    if timing is not None:
        before_s, delay_s = robot.drive.response_delay_s, _delay_s(robot, motors, timing)
        sigma_s = mean([one.sigmas[DELAY] for one in motors])
        yield Estimate("drive.response_delay_s", "s", before_s, delay_s, max(sigma_s, 0.001))


def _remark(robot: Robot, measured: Measurements) -> str:
    """What should be known of a result that is one."""
    headings = [event.heading_rad for event in measured.imu if event.heading_rad is not None]
    if len(robot.chassis.wheels) == 2 and len(headings) > 10:
        turns = [abs(math.remainder(after - before, math.tau)) for before, after in pairwise(headings)]
        if sum(turns) < 1.0:
            return (
                "the robot did not turn, so its wheels hung free: on the floor friction is higher, and the dead zone "
                "found here is too small for it; calibrate on the floor if there is room"
            )
    return ""


def _plot(name: str, runs: Sequence[Run], before: Sequence[float], after: Sequence[float]) -> Plot:
    """The answer to the first duties: speeds as measured, and by the model before and after."""
    run = runs[0]
    begin_s = run.inputs[0].stamp_s
    inside = [i for i, sample in enumerate(run.samples) if sample.stamp_s - begin_s < PLOTTED_S]
    stamps = [run.samples[i].stamp_s for i in inside]

    def speeds(angle: Callable[[int], float]) -> Iterator[float]:
        for i in range(1, len(inside)):
            dt_s = stamps[i] - stamps[i - 1]
            yield (angle(inside[i]) - angle(inside[i - 1])) / dt_s if dt_s > 0 else 0.0

    times = tuple([(stamps[i] + stamps[i - 1]) / 2 - begin_s for i in range(1, len(stamps))])
    model_before, model_after = simulated(before, run), simulated(after, run)
    series = (
        Series("measured", times, tuple(speeds(lambda i: run.samples[i].angle_rad)), points=True),
        Series("model before", times, tuple(speeds(model_before.__getitem__))),
        Series("model after", times, tuple(speeds(model_after.__getitem__))),
    )
    return Plot(f"step response of {name}", "time (s)", "speed (rad/s)", series)
