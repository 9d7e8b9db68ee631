"""Fits the model of one wheel's motor to the angle that it turned under known duties (output error).

The model (``chefbotd.motion.motor_model``) is simulated with the duties as the board put them into force, and the angle
is compared within each stretch of constant duty: L. Ljung, "System Identification", 2nd ed., ch. 7 (Gauss-Newton on the
simulated output), with Huber's weights. The standard deviations are those of independent stretches (a sandwich
estimator), because what disturbs a motor disturbs all readings of a stretch alike.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from chefbotd.core.record import Record
from chefbotd.core.scan import Floats

ROUNDS = 30
FIRST_DAMPING, MOST_DAMPING = 1e-3, 1e6
"""Of Levenberg and Marquardt."""

MOST_CONDITION = 1e8
"""Of the normal equations, scaled to a diagonal of ones: beyond it some parameters cannot be told apart."""

CONVERGED_SHARE = 1e-4
HUBER = 2.0
"""Residuals beyond so many times their median deviation weigh less."""

MAD_TO_SIGMA = 1.4826
GAIN, DEAD_ZONE, LAG = 0, 1, 2
DELAY, SPIN = 6, 7
"""The parameters: gain, dead zone and time constant forward, the same in reverse, the delay, and the ratio of the time
constants on the spot to those straight ahead, where the wheels move another inertia."""

STEPS = (1e-4, 0.01, 1e-4, 1e-4, 0.01, 1e-4, 1e-4, 1e-3)
"""For the derivatives: a share of the gain, then duty and seconds."""


class Input(Record, frozen=True):
    """From ``stamp_s`` on the motor had this duty (forward positive), as strong as at the models' voltage."""

    stamp_s: float
    duty: float


class AngleSample(Record, frozen=True):
    """The wheel's angle at a time."""

    stamp_s: float
    angle_rad: float


class MotorRun(Record, frozen=True):
    """What was driven from rest without a pause: the inputs, the last one zero, and the angles meanwhile.

    ``spins``: the wheels of the two sides were driven against each other.
    """

    spins: bool
    inputs: tuple[Input, ...]
    samples: tuple[AngleSample, ...]


class FittedMotor(Record, frozen=True):
    """The parameters (in the order above) with their standard deviations, and the residuals' root mean square in rad."""

    parameters: tuple[float, ...]
    sigmas: tuple[float, ...]
    before_rad: float
    after_rad: float
    count: int


def advance(parameters: Sequence[float], speed: float, duty: float, dt_s: float) -> tuple[float, float]:
    """Speed and turned angle after ``dt_s`` of a constant duty; a wheel that comes to rest in it stays there."""
    ahead = speed > 0 or (speed == 0 and duty > 0)
    first = 0 if ahead else 3
    sign = 1.0 if ahead else -1.0
    gain, dead_zone, lag_s = parameters[first], parameters[first + 1], parameters[first + 2]
    steady, now = gain * (duty * sign - dead_zone), speed * sign
    if now == 0 and steady <= 0:
        return 0.0, 0.0
    if steady < 0:
        rests_after_s = lag_s * math.log((now - steady) / -steady)
        if rests_after_s < dt_s:
            return 0.0, sign * (
                steady * rests_after_s + (now - steady) * lag_s * -math.expm1(-rests_after_s / lag_s)
            )
    passed = -math.expm1(-dt_s / lag_s)
    reached = now + (steady - now) * passed
    return sign * reached, sign * (steady * dt_s + (now - steady) * lag_s * passed)


def simulate_run(parameters: Sequence[float], run: MotorRun) -> list[float]:
    """The angle at each sample, from 0 at rest."""
    delay_s = parameters[DELAY]
    if run.spins:
        gain, dead_zone, lag_s, reverse_gain, reverse_dead_zone, reverse_lag_s = parameters[:DELAY]
        ratio = parameters[SPIN]
        parameters = gain, dead_zone, lag_s * ratio, reverse_gain, reverse_dead_zone, reverse_lag_s * ratio
    angles, speed, angle, at_s = [], 0.0, 0.0, run.samples[0].stamp_s
    changes = [(entry.stamp_s + delay_s, entry.duty) for entry in run.inputs]
    duty, place = 0.0, 0
    for sample in run.samples:
        while place < len(changes) and changes[place][0] <= sample.stamp_s:
            change_s, after = changes[place]
            if change_s > at_s:
                speed, turned = advance(parameters, speed, duty, change_s - at_s)
                angle, at_s = angle + turned, change_s
            duty, place = after, place + 1
        if sample.stamp_s > at_s:
            speed, turned = advance(parameters, speed, duty, sample.stamp_s - at_s)
            angle, at_s = angle + turned, sample.stamp_s
        angles.append(angle)
    return angles


def stretches(run: MotorRun) -> list[range]:
    """The samples of each stretch of constant duty, each with the last sample before it."""
    begins = [entry.stamp_s for entry in run.inputs]
    parts = []
    for begin_s, end_s in pairwise(begins):
        inside = [i for i, sample in enumerate(run.samples) if begin_s <= sample.stamp_s < end_s]
        if inside:
            parts.append(range(max(inside[0] - 1, 0), inside[-1] + 1))
    return parts


def _residuals(at: Floats, runs: Sequence[MotorRun]) -> tuple[Floats, Floats]:
    """How much farther the wheel turned than the model since the beginning of each stretch, and the stretch's number."""
    parameters: list[float] = at.tolist()
    values, groups, group = [], [], 0
    for run in runs:
        model = simulate_run(parameters, run)
        for stretch in stretches(run):
            first = stretch[0]
            for i in stretch[1:]:
                measured = run.samples[i].angle_rad - run.samples[first].angle_rad
                values.append(measured - (model[i] - model[first]))
                groups.append(group)
            group += 1
    return np.array(values), np.array(groups, dtype=float)


def _clip_parameters(parameters: Floats) -> Floats:
    """Positive gains and time constants, no negative dead zone, a delay that a board can have."""
    low = np.array([1e-5, 0.0, 0.005] * 2 + [-0.05, 0.3])
    high = np.array([100.0, 3e4, 1.0] * 2 + [0.2, 3.0])
    return np.clip(parameters, low, high)


def _jacobian(parameters: Floats, free: Sequence[int], runs: Sequence[MotorRun], residuals: Floats) -> Floats:
    columns = []
    for i in free:
        size = STEPS[i] * parameters[i] if i in (GAIN, GAIN + 3) else STEPS[i]
        moved = parameters.copy()
        moved[i] += size
        columns.append((_residuals(moved, runs)[0] - residuals) / size)
    return np.array(columns).T


def fit(runs: Sequence[MotorRun], start: Sequence[float]) -> FittedMotor | None:
    """The parameters that explain the runs best; None where they do not determine all of them.

    With runs of one kind only, the ratio ``SPIN`` stays as it is, without a standard deviation.
    """
    free = range(DELAY + 1 if len({run.spins for run in runs}) < 2 else SPIN + 1)
    parameters = _clip_parameters(np.array(start, dtype=float))
    residuals, groups = _residuals(parameters, runs)
    if len(residuals) <= len(free):
        return None
    before_rad = float(np.sqrt(np.mean(residuals**2)))
    damping = FIRST_DAMPING
    for _ in range(ROUNDS):
        weights, jacobian = _weights(residuals), _jacobian(parameters, free, runs, residuals)
        normal = jacobian.T @ (jacobian * weights[:, None])
        if _is_singular(normal):
            return None
        moved = parameters.copy()
        moved[list(free)] -= np.linalg.solve(
            normal + damping * np.diag(np.diag(normal)), jacobian.T @ (weights * residuals)
        )
        moved = _clip_parameters(moved)
        after, _ = _residuals(moved, runs)
        if np.sum(weights * after**2) < np.sum(weights * residuals**2):
            share = float(np.max(np.abs(moved - parameters) / (np.abs(parameters) + 1e-3)))
            parameters, residuals, damping = moved, after, damping / 5
            if share < CONVERGED_SHARE:
                break
        else:
            damping *= 10
            if damping > MOST_DAMPING:
                break
    after_rad = float(np.sqrt(np.mean(residuals**2)))
    sigmas = _sigmas(parameters, free, runs, residuals, groups)
    return FittedMotor(
        tuple(parameters.tolist()), tuple(sigmas.tolist()), before_rad, after_rad, len(residuals)
    )


def _is_singular(normal: Floats) -> bool:
    """Whether some parameter, or a combination of them, changes nothing."""
    scale = np.sqrt(np.diag(normal))
    return bool(np.any(scale == 0) or np.linalg.cond(normal / np.outer(scale, scale)) > MOST_CONDITION)


def _weights(residuals: Floats) -> Floats:
    sigma = MAD_TO_SIGMA * float(np.median(np.abs(residuals))) + 1e-6
    return np.minimum(1.0, HUBER * sigma / np.maximum(np.abs(residuals), 1e-12))


def _sigmas(
    parameters: Floats, free: Sequence[int], runs: Sequence[MotorRun], residuals: Floats, groups: Floats
) -> Floats:
    """The standard deviations, from how much the stretches disagree."""
    weights, jacobian = _weights(residuals), _jacobian(parameters, free, runs, residuals)
    inverse = np.linalg.pinv(jacobian.T @ (jacobian * weights[:, None]))
    pulls = [
        jacobian[groups == group].T @ (weights * residuals)[groups == group] for group in np.unique(groups)
    ]
    scores = np.array(pulls)
    spread = len(scores) / max(len(scores) - len(free), 1)
    covariance = inverse @ (spread * scores.T @ scores) @ inverse
    sigmas = np.zeros(len(parameters))
    sigmas[list(free)] = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return sigmas
