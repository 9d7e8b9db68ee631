"""Range sensors that miss: whether the robot touches what it is driven at, creeps to it, and believes a free way late.

Each robot is driven at a wall at ``SPEED_M_S`` for a minute, and for ``WATCHED_S`` more, in which it must not come
nearer by anything. Then something that stood before it is taken away, with the same sensor, and the time is taken until
it moves.

``python -m benchmarks.missed_echoes`` runs all; a name (``half``) only what is called so.
"""

import asyncio
import math
import sys
from collections.abc import Mapping
from types import MappingProxyType

from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.core.record import Record
from chefbotd.settings import Settings, load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot

SPEED_M_S, COMMAND_S = 0.2, 0.05
APPROACH_S, WATCHED_S, MOVED_M, PATIENCE_S = 60.0, 40.0, 0.005, 60.0
SILENT_APPROACH_S = 300.0
"""A board that is silent for a second at each miss comes to the wall at a few millimetres a second."""

MISSES: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "none": {},
        "twentieth": {"lost_echo_share": 0.05},
        "fifth": {"lost_echo_share": 0.2},
        "third": {"lost_echo_share": 0.35},
        "half": {"lost_echo_share": 0.5},
        "every_second": {"lost_echo_every": 2},
        "bursts_of_three": {"lost_echo_share": 0.05, "lost_echo_burst": 3},
        "far_fifth": {"far_echo_share": 0.2},
        "far_half": {"far_echo_share": 0.5},
    }
)
SILENT = "classic, silent for a second"
BOARDS: Mapping[str, Mapping[str, object]] = MappingProxyType(
    {
        SILENT: {},
        "classic, not silent": {"sim.board.blocking_ultrasonic": False},
        "our firmware": {"sim.board.sketch": "chefbot", "encoders.counted_by": "firmware"},
    }
)
GLITCHES: Mapping[str, float] = MappingProxyType(
    {"none": 0.0, "twentieth": 0.05, "fifth": 0.2, "third": 0.35, "half": 0.5}
)


class Outcome(Record, frozen=True):
    """The least gap before the bumper, whether it touched, how far it crept, and when it went on."""

    gap_m: float
    touched: bool
    crept_m: float
    went_on_s: float


def settings_of(board: str, misses: str, seed: int = 1, **more: object) -> Settings:
    """A ChefBot whose sensor misses so."""
    own = {f"sim.ultrasonic.{key}": value for key, value in MISSES[misses].items()}
    return load(packaged("chefbot"), overrides={**BOARDS[board], **own, "sim.seed": seed, **more})


def khan(glitches: str, seed: int = 1) -> Settings:
    """A KHAN whose infrared sensor glitches so, before the room's cupboard."""
    share = {"sim.infrared.glitch_share": GLITCHES[glitches]}
    return load(packaged("khan"), overrides={"sim.world.start_y_m": 0.8, **share, "sim.seed": seed})


async def _drive(robot: SimulatedRobot, seconds: float, linear_m_s: float = SPEED_M_S) -> bool:
    """Whether it touched anything; a fault is no end: the robot is armed again."""
    touched = False
    for _ in range(round(seconds / COMMAND_S)):
        try:
            await robot.client.drive(linear_m_s, 0.0)
        except CallError:
            await robot.client.arm()
        await asyncio.sleep(COMMAND_S)
        touched |= robot.board.truth(0.0).in_contact
    return touched


def _x_m(robot: SimulatedRobot) -> float:
    return robot.board.truth(0.0).world_from_base.x_m


async def _went_on_s(robot: SimulatedRobot) -> float:
    """Something is put before the standing robot, stays for 20 s, and is gone: how long until the robot has moved."""
    here = robot.board.truth(0.0).world_from_base
    ahead_m = 0.18 + 0.2 + 0.25
    robot.board.crowd.put(
        "somebody",
        here.x_m + ahead_m * math.cos(here.heading_rad),
        here.y_m + ahead_m * math.sin(here.heading_rad),
    )
    await _drive(robot, 20.0)
    robot.board.crowd.take_away("somebody")
    began_m = _x_m(robot)
    for tick in range(round(PATIENCE_S / COMMAND_S)):
        if abs(_x_m(robot) - began_m) > MOVED_M:
            return tick * COMMAND_S
        await _drive(robot, COMMAND_S)
    return math.inf


def measure(settings: Settings, approach_s: float = APPROACH_S) -> Outcome:
    """All of it, on one robot."""

    async def run() -> Outcome:
        async with simulated_robot(settings) as robot:
            await asyncio.sleep(1.5)
            went_on_s = await _went_on_s(robot)
            touched = await _drive(robot, approach_s)
            stood_m = _x_m(robot)
            touched |= await _drive(robot, WATCHED_S)
            beam = (await robot.client.call("get_state"))["topics"]["ranges"]["data"]["ranges"][0]
            gap_m = beam["range_m"] or 0.0
            return Outcome(gap_m, touched, _x_m(robot) - stood_m, went_on_s)

    return run_virtual(run())


def main(chosen: list[str]) -> None:
    """Print a row for each board and kind of misses."""
    rows = [(board, misses, settings_of(board, misses)) for board in BOARDS for misses in MISSES]
    rows += [("KHAN's infrared", glitches, khan(glitches)) for glitches in GLITCHES]
    print(f"{'board':30} {'misses':16} {'touched':8} {'crept':>8} {'last reading':>13} {'goes on after':>14}")
    for board, misses, settings in rows:
        if chosen and misses not in chosen and board not in chosen:
            continue
        got = measure(settings, SILENT_APPROACH_S if board == SILENT else APPROACH_S)
        print(
            f"{board:30} {misses:16} {'YES' if got.touched else 'no':8} {got.crept_m * 1e3:5.1f} mm"
            f" {got.gap_m:11.2f} m {got.went_on_s:12.2f} s",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])
