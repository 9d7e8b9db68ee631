"""The steps ``encoders`` and ``battery``: a person turns a wheel by hand, or reads a voltmeter."""

import math
from statistics import fmean, stdev

from chefbotd.components.calibration.algorithms.step import (
    Ask,
    ConfiguredRobot,
    Estimate,
    Measurements,
    Move,
    Procedure,
    Residual,
    Status,
    StepDefinition,
    StepResult,
)

TURN_SIGMA = 0.01
"""How exactly a person turns a wheel to a mark, in turns (assumed)."""

WRONG_SHARE = 0.5
TURNS = "encoders.turns."

VOLTAGE = "battery.voltage_v"
LEAST_READINGS, REST_S = 5, 2.0
VOLTMETER_V = 0.01
"""What a voltmeter's last digit leaves open."""

MOST_OFF = 0.25


def _turn_wheels(robot: ConfiguredRobot) -> Procedure:
    wheels = robot.chassis.wheels
    for number, wheel in enumerate(wheels):
        text = f"Turn {wheel.name} forward by hand, whole turns from mark to mark, and type how many. 0 leaves it out."
        yield Ask(f"{TURNS}{wheel.name}", text, "turns", 0, 100, number / len(wheels))


def _fit_turns(robot: ConfiguredRobot, measurements: Measurements) -> StepResult:
    """The counts of a turn: what each wheel counted in all, over the turns that were typed."""
    shares, sigmas = list[float](), list[float]()
    for index, wheel in enumerate(robot.chassis.wheels):
        turns = measurements.answers.get(f"{TURNS}{wheel.name}", 0.0)
        if turns < 1:
            continue
        counted = sum(reading.travel_rad[index] for reading in measurements.wheels) / math.tau / turns
        if abs(counted) < 0.05:
            return StepResult(
                "encoders", Status.REFUSED, f"{wheel.name} was not seen to turn: is its encoder wired?"
            )
        if counted < 0:
            reason = f"{wheel.name} counts backwards: turn the sign of its encoder round"
            return StepResult("encoders", Status.REFUSED, reason)
        if abs(counted - 1) > WRONG_SHARE:
            reason = (
                f"{wheel.name} counted {counted:.2f} turns for each: check the counts of a turn and the gear"
            )
            return StepResult("encoders", Status.REFUSED, reason)
        shares.append(counted)
        sigmas.append(TURN_SIGMA / turns)
    if not shares:
        return StepResult("encoders", Status.NOT_ENOUGH, "no wheel was turned")
    if max(shares) - min(shares) > 6 * max(sigmas):
        listed = ", ".join(f"{share:.3f}" for share in shares)
        return StepResult(
            "encoders", Status.REFUSED, f"the wheels disagree: they counted {listed} turns for each"
        )
    share, sigma = fmean(shares), math.sqrt(sum(one**2 for one in sigmas)) / len(sigmas)
    if abs(share - 1) <= 3 * sigma:
        return StepResult("encoders", Status.PASSED, f"the counts of a turn are right to {100 * sigma:.1f} %")
    counts = robot.encoders.counts_per_turn
    estimate = Estimate("encoders.counts_per_turn", "", counts, counts * share, counts * sigma)
    return StepResult("encoders", Status.PASSED, "", (estimate,))


def _read_voltmeter(robot: ConfiguredRobot) -> Procedure:
    yield Move(None, REST_S, "measures the battery at rest")
    text = "Measure the battery with a voltmeter, at its own terminals, and type what it shows."
    yield Ask(VOLTAGE, text, "V", 1.0, 60.0, 0.5)


def _fit_divider(robot: ConfiguredRobot, measurements: Measurements) -> StepResult:
    """The divider that makes the mean of the readings what the voltmeter shows."""
    if robot.battery is None:
        return StepResult("battery", Status.REFUSED, NO_BATTERY)
    if VOLTAGE not in measurements.answers:
        return StepResult("battery", Status.NOT_ENOUGH, "nobody has typed what a voltmeter shows")
    read = [reading.voltage_v for reading in measurements.battery]
    if len(read) < LEAST_READINGS:
        return StepResult(
            "battery", Status.NOT_ENOUGH, f"{len(read)} of {LEAST_READINGS} readings of the battery"
        )
    mean_v, spread_v, typed_v = fmean(read), stdev(read), measurements.answers[VOLTAGE]
    if mean_v <= 0 or abs(typed_v / mean_v - 1) > MOST_OFF:
        reason = f"the board reads {mean_v:.2f} V, the voltmeter {typed_v:.2f} V: check the wiring and the reference"
        return StepResult("battery", Status.REFUSED, reason)
    before = robot.battery.divider_ratio
    after = before * typed_v / mean_v
    sigma = after * math.hypot(VOLTMETER_V / typed_v, spread_v / math.sqrt(len(read)) / mean_v)
    return StepResult(
        "battery",
        Status.PASSED,
        estimates=(Estimate("battery.divider_ratio", "", before, after, sigma),),
        residuals=(Residual("battery", "V", abs(mean_v - typed_v), spread_v, len(read)),),
    )


NO_BATTERY = "no battery is configured"


def _battery_missing(robot: ConfiguredRobot) -> str:
    return NO_BATTERY if robot.battery is None else ""


def _nothing_missing(robot: ConfiguredRobot) -> str:
    return ""


ENCODERS = StepDefinition(
    "encoders",
    "the counts of a wheel's turn",
    "Lift the wheels off the floor, and make a mark on each tyre and beside it.",
    0.0,
    _nothing_missing,
    _turn_wheels,
    _fit_turns,
)
BATTERY = StepDefinition(
    "battery",
    "the voltage divider of the battery",
    "Have a voltmeter at hand.",
    0.0,
    _battery_missing,
    _read_voltmeter,
    _fit_divider,
)
