"""The result of the step ``motors``: the models of all wheels, the gains that follow, and plots of both."""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from statistics import mean

from chefbotd.components.calibration.algorithms.motor_fit import (
    AngleSample,
    FittedMotor,
    Input,
    MotorRun,
    fit,
    simulate_run,
)
from chefbotd.components.calibration.algorithms.motor_gains import (
    gains_estimates,
    supply_and_delay,
    timing_of,
)
from chefbotd.components.calibration.algorithms.motor_wiring import wrong_wiring
from chefbotd.components.calibration.algorithms.step import (
    ConfiguredRobot,
    Estimate,
    Measurements,
    Plot,
    Residual,
    Series,
    Status,
    StepResult,
)
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

PLOTTED_S = 2.4

LEAST_TURNED_RAD = 1.0
"""A robot that the IMU saw turn by less in the whole step hung free: it turns by several turns."""

PARAMETERS = (("gain_rad_s_per_duty", "rad/s"), ("dead_zone_duty", "duty"), ("time_constant_s", "s"))


def fit_motors(robot: ConfiguredRobot, measured: Measurements) -> StepResult:
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
    motors: list[FittedMotor] = []
    wheel_runs: list[tuple[MotorRun, ...]] = []
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
    timing = timing_of(measured)
    estimates = [
        *_models(robot, motors),
        *gains_estimates(robot, motors, timing),
        *supply_and_delay(robot, motors, voltage_v, timing),
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


def _start(robot: ConfiguredRobot, number: int) -> tuple[float, ...]:
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


def _changes(robot: ConfiguredRobot, measured: Measurements) -> Iterator[tuple[float, tuple[float, ...]]]:
    """When which duties came into force (forward positive): by the board's echo, else by the steps before them."""
    signs = [wheel.motor_sign for wheel in robot.chassis.wheels]
    before: tuple[float, ...] = ()
    for event in measured.echoed or measured.driven:
        duty = tuple([value * sign for value, sign in zip(event.duty, signs, strict=True)])
        if duty != before:
            before = duty
            yield event.stamp_s, duty


def _runs(
    robot: ConfiguredRobot, measured: Measurements, number: int, voltage_v: float | None
) -> tuple[MotorRun, ...]:
    """The drives of all wheels from rest; those of one wheel alone are left out."""
    runs: list[MotorRun] = []
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
) -> MotorRun:
    begin_s, end_s = inputs[0].stamp_s, inputs[-1].stamp_s
    samples = [
        AngleSample(event.stamp_s, event.position_rad[number])
        for event in measured.wheels
        if begin_s - BEFORE_S <= event.stamp_s <= end_s
    ]
    supplied = [
        Input(entry.stamp_s, entry.duty * _supply(measured, entry.stamp_s, after.stamp_s, voltage_v))
        for entry, after in pairwise(inputs)
    ]
    return MotorRun(spins, (*supplied, inputs[-1]), tuple(samples))


def _supply(measured: Measurements, from_s: float, to_s: float, voltage_v: float | None) -> float:
    """The battery's voltage over a stretch, as a share of the mean."""
    inside = [event.voltage_v for event in measured.battery if from_s <= event.stamp_s < to_s]
    return mean(inside) / voltage_v if inside and voltage_v else 1.0


def _unbelievable(robot: ConfiguredRobot, name: str, fitted: FittedMotor) -> str:
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


def _residual(name: str, fitted: FittedMotor) -> Residual:
    return Residual(f"angle of {name}", "rad", fitted.before_rad, fitted.after_rad, fitted.count)


def _models(robot: ConfiguredRobot, motors: Sequence[FittedMotor]) -> Iterator[Estimate]:
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


def _remark(robot: ConfiguredRobot, measured: Measurements) -> str:
    """What should be known of a result that is one."""
    headings = [event.heading_rad for event in measured.imu if event.heading_rad is not None]
    turns = [abs(math.remainder(after - before, math.tau)) for before, after in pairwise(headings)]
    if len(robot.chassis.wheels) > 2 or (len(turns) > 10 and sum(turns) < LEAST_TURNED_RAD):
        return "the wheels hung free: on the floor friction is higher and the time constants are longer than found here"
    return ""


def _plot(name: str, runs: Sequence[MotorRun], before: Sequence[float], after: Sequence[float]) -> Plot:
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
    model_before, model_after = simulate_run(before, run), simulate_run(after, run)
    series = (
        Series("measured", times, tuple(speeds(lambda i: run.samples[i].angle_rad)), points=True),
        Series("model before", times, tuple(speeds(model_before.__getitem__))),
        Series("model after", times, tuple(speeds(model_after.__getitem__))),
    )
    return Plot(f"step response of {name}", "time (s)", "speed (rad/s)", series)
