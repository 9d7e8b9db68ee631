"""The step ``motors``: dead zone, gain and time constant of each wheel's motor in both directions, and the gains.

First each wheel alone is turned by less than half a radian, so that a motor or an encoder that is reversed or swapped is
found before anything depends on it. Then all wheels run through a few duties in both directions: on the spot where there
are two wheels, and with more of them, which skid when they turn, on blocks. Last come short ways ahead and back: the
robot's mass is another inertia than its resistance to being turned, and the time constants are those straight ahead.
"""

import math
from collections.abc import Generator, Sequence

from chefbotd.components.calibration.algorithms.motor_result import HANGS_FREE, NAME, fit_motors
from chefbotd.components.calibration.algorithms.motor_wiring import (
    PROBE_RAD,
    PROBE_SHARES,
    turned_rad,
    wrong_wiring,
)
from chefbotd.components.calibration.algorithms.step import (
    Ask,
    ConfiguredRobot,
    Measurements,
    Move,
    Procedure,
    StepDefinition,
)
from chefbotd.core.geometry import WheelDuties
from chefbotd.motion.kinematics import Side

PROBE_S = 0.3
BACKWARDS_RAD = 0.4
"""How much farther a wheel is turned that counts backwards: together less than ``safety.wheels.reversed_rad``."""

SPEEDS = (0.5, 1.0, 0.2, 0.75, 0.35, 0.9, 0.15)
"""Shares of the highest speed, in the order in which each direction is driven."""

HOPS = (0.9, 0.3, 0.6, 0.2, 1.0, 0.45, 0.75)
"""The same for short drives straight on, each followed by one back."""

STRETCH_S, HOP_S = 0.8, 0.5
HIGHEST_SHARE = 0.9
"""Of the rim speed that the wheels can reach: battery and motors may be weaker than configured."""


def _duties(robot: ConfiguredRobot, shares: Sequence[float]) -> WheelDuties:
    """The duty at which each wheel should turn at these shares of the highest speed, by what is known of it."""
    most_m_s = HIGHEST_SHARE * robot.drive.max_rim_speed_m_s
    duty = []
    for wheel, share in zip(robot.chassis.wheels, shares, strict=True):
        gains = robot.gains[wheel.name]
        value = gains.ks + gains.kv * abs(share) * most_m_s
        if not gains.kv:
            value = abs(share) * HIGHEST_SHARE * robot.drive.max_duty
        duty.append(round(math.copysign(min(value, robot.drive.max_duty), share)))
    return WheelDuties(tuple(duty))


def _probes(robot: ConfiguredRobot) -> Generator[Move, Measurements, Measurements]:
    """Turn each wheel alone, a little; one that counts backwards a little more, so that the IMU sees which way."""
    wheels, measured = robot.chassis.wheels, Measurements()
    for number, wheel in enumerate(wheels):
        text, done = f"turns {wheel.name} a little", 0.02 + 0.1 * number / len(wheels)
        for share in PROBE_SHARES:
            duty = round(share * robot.drive.max_duty)
            alone = WheelDuties(tuple(duty if i == number else 0 for i in range(len(wheels))))
            part = yield Move(alone, PROBE_S, text, done)
            turned = turned_rad(part)
            measured = Measurements(
                wheels=measured.wheels + part.wheels, driven=measured.driven + part.driven
            )
            if max(map(abs, turned)) > PROBE_RAD:
                if turned[number] < -PROBE_RAD:
                    yield Move(alone, min(PROBE_S * BACKWARDS_RAD / -turned[number], 1.0), text, done)
                break
    return measured


def procedure(robot: ConfiguredRobot) -> Procedure:
    """Each wheel alone, a little; then every wheel at several duties."""
    wheels = robot.chassis.wheels
    if len(wheels) > 2:
        answered = yield Ask(
            HANGS_FREE, "Do all wheels hang free, on blocks (1: yes, 0: no)?", "", 0.0, 1.0, 0.01
        )
        if answered.answers[HANGS_FREE] < 1.0:
            return
    measured = yield from _probes(robot)
    if wrong_wiring(robot, measured):
        return
    yield Move(None, 0.5, "stands", 0.12)
    turns = [-1.0 if wheel.side is Side.LEFT and len(wheels) == 2 else 1.0 for wheel in wheels]
    for direction, done in ((1.0, 0.12), (-1.0, 0.36)):
        for place, speed in enumerate(SPEEDS):
            duties = _duties(robot, [direction * turn * speed for turn in turns])
            is_last = place == len(SPEEDS) - 1
            share = done + 0.24 * place / len(SPEEDS)
            yield Move(duties, STRETCH_S, "measures the motors", share, settled=is_last)
    for place, speed in enumerate(HOPS):
        for direction in (1.0, -1.0):
            duties = _duties(robot, [direction * speed for _ in wheels])
            yield Move(duties, HOP_S, "measures the motors on short ways", 0.6 + 0.4 * place / len(HOPS))


def _missing(robot: ConfiguredRobot) -> str:
    return ""


STEP = StepDefinition(
    name=NAME,
    purpose="how each motor turns its wheel: dead zone, speed by duty and time constant, and the gains that follow",
    preparation=(
        "Put a robot with two wheels on a level floor, where it turns on the spot and goes 15 cm ahead and back; put "
        "one with more wheels, which "
        "skid when they turn, on blocks, so that they hang free."
    ),
    space_m=0.3,
    missing=_missing,
    procedure=procedure,
    fit=fit_motors,
)
