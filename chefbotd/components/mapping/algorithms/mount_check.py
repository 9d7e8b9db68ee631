"""Checks the mount of the lidar: scans and wheels must agree about the direction of travel.

A lidar that is turned in its mount is found in the map all the same, with the robot's heading turned by as much. While
the robot stands, nothing contradicts that. When it drives, its way by the scans points elsewhere than by the wheels.
"""

import math
from collections.abc import Sequence
from typing import Final

from chefbotd.core.geometry import wrap_angle
from chefbotd.core.poses import Floats, between
from chefbotd.core.record import Record, replace
from chefbotd.core.sentence import Sentence

WINDOW_M: Final = 0.08
WINDOWS: Final = 3
"""So many ways of this length, one after the other, all say the same;"""

ALIKE_RAD: Final = 0.35
"""which is, that they differ by no more than this from the first."""

LEAST_RAD: Final = 0.5
"""Less is no wrong mount: wheels slip, and a match has its error."""

MOST_TURN_RAD: Final = 0.5
"""A way on which the robot turns by more says nothing: the lidar's own place moves with the heading."""

MIN_SHARE: Final = 0.6
"""Both ways are as long as each other, but for this share: wheels that spin, and a robot that is pushed, are not."""


class MountCheck(Record, frozen=True):
    """Where the present way began, by odometry and in the map, and what the ways before it said.

    ``turned_rad`` is known once it is believed: by so much the lidar is turned in its mount, CCW positive.
    """

    begun: tuple[Floats, Floats] | None = None
    said_rad: tuple[float, ...] = ()
    turned_rad: float | None = None


def check_scan(state: MountCheck, odometry: Floats, map_from_base: Floats | None) -> MountCheck:
    """Take a scan's poses into account: by odometry, and as found in the map (None: scans do not fit just now)."""
    if state.turned_rad is not None:
        return state
    if map_from_base is None:
        return MountCheck()
    if state.begun is None:
        return replace(state, begun=(odometry, map_from_base))
    by_wheels, by_scans = between(state.begun[0], odometry), between(state.begun[1], map_from_base)
    if abs(by_wheels[2]) > MOST_TURN_RAD:
        return MountCheck((odometry, map_from_base))
    length_m, other_m = math.hypot(*by_wheels[:2]), math.hypot(*by_scans[:2])
    if length_m < WINDOW_M:
        return state
    if min(length_m, other_m) < MIN_SHARE * max(length_m, other_m):
        return MountCheck((odometry, map_from_base))
    off = math.atan2(by_wheels[1], by_wheels[0]) - math.atan2(by_scans[1], by_scans[0])
    return replace(_say_offset(state, wrap_angle(off)), begun=(odometry, map_from_base))


def mount_problem(check: MountCheck, lidars: Sequence[str]) -> str:
    """What is wrong, for people; empty where nothing is known to be."""
    if check.turned_rad is None:
        return ""
    degrees = round(math.degrees(check.turned_rad))
    return Sentence(
        "mapping.mount",
        "the {lidar} and the wheels disagree about where the robot drives: "
        "the lidar seems to be turned by about {degrees} degrees "
        "against its configured mounting, or wheels have the wrong sign",
        lidar=_name_lidars(lidars),
        degrees=180 if degrees == -180 else degrees,
    )


def _name_lidars(lidars: Sequence[str]) -> str:
    """With several the first is meant: the others' points are matched with its own."""
    if len(lidars) == 1:
        return Sentence("mapping.lidar", "lidar {name!r}", name=lidars[0])
    return Sentence(
        "mapping.lidars",
        "lidar {name!r} (with {others})",
        name=lidars[0],
        others=", ".join(map(repr, lidars[1:])),
    )


def _say_offset(state: MountCheck, off_rad: float) -> MountCheck:
    if abs(off_rad) < LEAST_RAD:
        return MountCheck()
    same = state.said_rad and abs(wrap_angle(off_rad - state.said_rad[0])) <= ALIKE_RAD
    said = (*state.said_rad, off_rad) if same else (off_rad,)
    if len(said) < WINDOWS:
        return MountCheck(None, said)
    middle = sum(wrap_angle(one_rad - said[0]) for one_rad in said) / len(said)
    return MountCheck(None, said, wrap_angle(said[0] + middle))
