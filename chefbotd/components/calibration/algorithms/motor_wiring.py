"""Finds motors and encoders that are reversed, swapped or dead, by a drive in which each wheel turned alone a little."""

import math
from collections.abc import Iterator

from chefbotd.components.calibration.algorithms.step import ConfiguredRobot, Measurements
from chefbotd.motion.kinematics import Side

PROBE_SHARES = (0.12, 0.16, 0.2, 0.25, 0.32, 0.4)
"""Of the full duty, one after the other until the wheel has moved."""

PROBE_RAD = 0.06
"""A wheel that turned less has not moved: its encoder may dither."""

OUTRUN = 3.0
"""Another wheel turned instead, if it turned so much farther."""


def turned_rad(measured: Measurements) -> tuple[float, ...]:
    """How far each wheel turned."""
    if not measured.wheels:
        return (0.0,)
    first, last = measured.wheels[0], measured.wheels[-1]
    before = [
        position - travel for position, travel in zip(first.position_rad, first.travel_rad, strict=True)
    ]
    return tuple([after - earlier for after, earlier in zip(last.position_rad, before, strict=True)])


def wrong_wiring(robot: ConfiguredRobot, measured: Measurements) -> str:
    """What is reversed, swapped or dead, by the stretches in which one wheel alone was driven; empty: nothing is."""
    return "; ".join(_check_probes(robot, measured))


def _check_probes(robot: ConfiguredRobot, measured: Measurements) -> Iterator[str]:
    names = [wheel.name for wheel in robot.chassis.wheels]
    for number, wheel in enumerate(robot.chassis.wheels):
        turned = _probe(robot, measured, number)
        if turned is None:
            continue
        own, others = turned[number], [angle if i != number else 0.0 for i, angle in enumerate(turned)]
        farthest = max(range(len(names)), key=lambda i: abs(others[i]))
        if abs(others[farthest]) > max(PROBE_RAD, OUTRUN * abs(own)):
            yield (
                f"{wheel.name} was driven and {names[farthest]} counted: the motors (or the encoders) are exchanged; "
                f"exchange the plugs of {wheel.name} and {names[farthest]}, or their order in the configuration"
            )
        elif own < -PROBE_RAD:
            yield f"{wheel.name} was driven forward and counted backwards: {_find_reversed(robot, measured, number)}"
        elif own < PROBE_RAD:
            share = PROBE_SHARES[-1]
            yield (
                f"{wheel.name} does not turn at {share:.0%} of the full duty: check the motor's power and wires, the "
                "encoder's plug, and whether the wheel is blocked"
            )


def _probe(robot: ConfiguredRobot, measured: Measurements, number: int) -> tuple[float, ...] | None:
    """How far each wheel turned from when this one was first driven alone until another was; None: it never was."""
    alone = _alone(measured, number)
    if not alone:
        return None
    end_s = min(
        [event.stamp_s for event in measured.driven if event.stamp_s > alone[-1] and any(event.duty)],
        default=math.inf,
    )
    inside = tuple(event for event in measured.wheels if alone[0] < event.stamp_s <= end_s)
    return turned_rad(Measurements(wheels=inside)) if inside else None


def _alone(measured: Measurements, number: int) -> list[float]:
    """When this wheel alone was driven."""
    return [
        event.stamp_s
        for event in measured.driven
        if event.duty[number] and not any(duty for i, duty in enumerate(event.duty) if i != number)
    ]


LEAST_TURN_RAD = 0.02
"""Of the robot, that counts: the quantum of the orientation on ChefBot's wire."""


def _find_reversed(robot: ConfiguredRobot, measured: Measurements, number: int) -> str:
    """Which of the two is reversed, where the IMU tells how the robot turned."""
    wheel = robot.chassis.wheels[number]
    motor = f"give its motor the sign {-wheel.motor_sign} in the configuration"
    encoder = f"give its encoder the sign {-wheel.encoder_sign} in the configuration"
    left_rad = _heading_change(measured, number)
    ahead_rad = -left_rad if wheel.side is Side.LEFT else left_rad
    if ahead_rad > LEAST_TURN_RAD:
        return f"its encoder is reversed; {encoder}"
    if ahead_rad < -LEAST_TURN_RAD:
        return f"its motor is reversed; {motor}, or exchange its wires"
    return f"its motor or its encoder is reversed; if it turned backwards, {motor}; if forwards, {encoder}"


def _heading_change(measured: Measurements, number: int) -> float:
    """How far the IMU turned while this wheel alone was driven; 0 where it says nothing."""
    alone = _alone(measured, number)
    headings = [
        (event.stamp_s, event.heading_rad)
        for event in measured.imu
        if event.heading_rad is not None and alone and alone[0] - 0.3 <= event.stamp_s <= alone[-1] + 0.8
    ]
    if len(headings) < 4:
        return 0.0
    return math.remainder(headings[-1][1] - headings[0][1], math.tau)
