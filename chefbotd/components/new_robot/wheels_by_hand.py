"""What only the robot itself can tell: its wheels, turned by hand, by their motors, and by turning on the floor."""

import math
from collections.abc import Mapping

from chefbotd.client import Client
from chefbotd.components.new_robot.interview import Interview
from chefbotd.components.new_robot.measuring import (
    LEAST_TURNED_RAD_S,
    UNKNOWN_COUNTS,
    MotorFigures,
    WheelSpeeds,
    count_positions,
    motor_figures,
    run_wheel,
)
from chefbotd.core.record import Record
from chefbotd.motion.kinematics import Side

TURNS, FLOOR_TURNS = 10, 3
LEAST_COUNTS_A_TURN = 4.0
MOST_DIFFERENCE = 0.03
"""Between the wheels: a tenth of a turn by hand is a hundredth of ten turns."""

MOST_TRACK_ERROR = 0.25
"""Between the tape and a turn on the floor: more is a miscounted turn, or a wheel that slipped."""

HANG_FREE = "Put the robot on blocks, so that all its wheels hang free."


class TurnedWheels(Record, frozen=True):
    """The counts of a wheel's turn, and the sign of each encoder."""

    counts_per_turn: float
    signs: Mapping[str, int]


async def turn_wheels(interview: Interview, robot: Client, wheels: list[str]) -> TurnedWheels | None:
    """Ask for ten turns of each wheel by hand, forward; None where they were skipped.

    The wheels of one robot have the same gears: where they differ, a turn was missed, and it is asked again.
    """
    while True:
        counted: dict[str, float] = {}
        for name in wheels:
            counts = await _turn_one(interview, robot, name)
            if counts is None:
                return None
            counted[name] = counts
        per_turn = [abs(counts) for counts in counted.values()]
        if max(per_turn) - min(per_turn) <= MOST_DIFFERENCE * max(per_turn):
            mean = sum(per_turn) / len(per_turn)
            return TurnedWheels(
                round(mean), {name: 1 if counts > 0 else -1 for name, counts in counted.items()}
            )
        listed = ", ".join(f"{name} {counts:.0f}" for name, counts in counted.items())
        interview.say(
            f"The wheels differ by more than {MOST_DIFFERENCE:.0%}: {listed} counts a turn. Once more."
        )


async def _turn_one(interview: Interview, robot: Client, name: str) -> float | None:
    while True:
        before = await count_positions(robot, UNKNOWN_COUNTS)
        turns = await interview.number(
            f"{HANG_FREE} Mark {name} and turn it forward by hand (as when the robot drives ahead), {TURNS} whole turns "
            "back to its mark. When it is done, type how many turns it was",
            "turns", 1, 100,
        )  # fmt: skip
        if turns is None:
            return None
        after = await count_positions(robot, UNKNOWN_COUNTS)
        counted = {wheel: after[wheel] - before[wheel] for wheel in after}
        others = {wheel: abs(counts) for wheel, counts in counted.items() if wheel != name}
        most = max(others, key=lambda wheel: others[wheel])
        if others[most] > abs(counted[name]):
            interview.say(
                f"That was counted by the encoder of {most} ({counted[most]:.0f}; of {name}: {counted[name]:.0f}): "
                "exchange their plugs, then turn it again."
            )
        elif abs(counted[name]) < LEAST_COUNTS_A_TURN * turns:
            interview.say(
                f"{name} counted {counted[name]:.0f}: are its encoder's wires in? Turn it again, or type skip."
            )
        else:
            interview.say(f"{name} counted {counted[name]:.0f}, {counted[name] / turns:.1f} a turn.")
            return counted[name] / turns


class FoundMotors(Record, frozen=True):
    """The sign of each motor, and what the motors give."""

    signs: Mapping[str, int]
    figures: MotorFigures


async def run_motors(
    interview: Interview, robot: Client, wheels: list[str], radius_m: float
) -> FoundMotors | None:
    """Run each wheel at a low and at full duty, on blocks; None where that was skipped, or a wheel did not turn."""
    if not await interview.typed_yes(
        f"{HANG_FREE} Each wheel is then turned by its motor, one after the other: slowly for a second, then AT FULL "
        "SPEED for two. Keep hands, hair and cables away. Ctrl-C stops everything."
    ):
        return None
    runs: dict[str, WheelSpeeds] = {}
    for name in wheels:
        run = await run_wheel(robot, name, radius_m)
        if problem := _problem(name, run):
            interview.say(problem)
            return None
        full_rad_s = run.full_rad_s[name]
        interview.say(
            f"{name}: {run.low_rad_s[name]:+.2f} rad/s at a duty of {run.low_duty:.0f}, {full_rad_s:+.2f} rad/s at "
            f"{run.full_duty:.0f} ({abs(full_rad_s) * radius_m:.2f} m/s)."
        )
        runs[name] = run
    signs = {name: 1 if run.full_rad_s[name] > 0 else -1 for name, run in runs.items()}
    return FoundMotors(signs, motor_figures(runs, radius_m))


def _problem(name: str, run: WheelSpeeds) -> str:
    speeds = {wheel: abs(speed) for wheel, speed in (run.full_rad_s or run.low_rad_s).items()}
    if run.refused:
        return f"{name} was stopped: {run.refused}. The motors are left out; mend that, and run this command again."
    most = max(speeds, key=lambda wheel: speeds[wheel])
    if speeds[most] < LEAST_TURNED_RAD_S:
        return f"{name} did not turn: are its motor's wires in, and the battery on? The motors are left out."
    if most != name:
        return f"{name} was driven and {most} turned: exchange their motors' plugs. The motors are left out."
    return ""


async def turn_on_floor(
    interview: Interview,
    robot: Client,
    sides: Mapping[str, Side],
    radius_m: float,
    counts_per_turn: float,
    tape_m: float | None,
) -> float | None:
    """The track by whole turns of the robot on the floor, by hand; None where it was skipped."""
    while True:
        before = await count_positions(robot, counts_per_turn)
        turns = await interview.number(
            "Put the robot on the floor, and mark its front and the floor. Turn it on the spot to the left by hand, "
            f"pushed at its body, {FLOOR_TURNS} whole turns back to the mark. When it is done, type how many "
            "turns it was",
            "turns", 1, 50,
        )  # fmt: skip
        if turns is None:
            return None
        after = await count_positions(robot, counts_per_turn)
        m_per_count = math.tau * radius_m / counts_per_turn
        rolled_m = {name: (after[name] - before[name]) * m_per_count for name in sides}
        track_m = _difference(rolled_m, sides) / (math.tau * turns)
        if track_m < 0:
            interview.say("It was turned to the right: the figure is the same, and is taken.")
            track_m = -track_m
        if tape_m is None or abs(track_m / tape_m - 1) <= MOST_TRACK_ERROR:
            interview.say(f"The wheels say {track_m:.4f} m for the track.")
            return track_m
        interview.say(
            f"The wheels say {track_m:.3f} m, the tape {tape_m:.3f} m: more than {MOST_TRACK_ERROR:.0%} apart. Was a "
            "turn missed, or did a wheel slip? Turn it again, or type skip to keep the tape's."
        )


def _difference(rolled_m: Mapping[str, float], sides: Mapping[str, Side]) -> float:
    """How much farther the right side rolled than the left one."""
    means = {}
    for side in Side:
        of_side = [rolled for name, rolled in rolled_m.items() if sides[name] is side]
        means[side] = sum(of_side) / len(of_side)
    return means[Side.RIGHT] - means[Side.LEFT]
