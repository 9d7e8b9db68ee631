"""Where a sensor sits on the robot, by the transforms of a bag: in three dimensions, as others mount theirs."""

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record

LEVEL_RAD: Final = math.radians(5.0)
"""A lidar that is tilted by less is level: at 5 degrees a reading of 4 m is 15 mm too long."""

Matrix = NDArray[np.float64]


class CannotPlaceError(Exception):
    """The bag does not tell where a sensor sits, or it sits so that its scans are no plan of the floor."""


class Mount(Record, frozen=True):
    """A sensor's place on the robot, seen from above; ``upside_down`` its bearings grow clockwise."""

    place: Pose2D
    upside_down: bool = False


def plain(frame: str) -> str:
    """A frame's name as ROS 2 has it: tf of ROS 1 began names with a slash."""
    return frame.strip().lstrip("/")


class Frames:
    """The latest transform of each frame in its parent."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Matrix]] = {}

    def add(self, message: Any) -> None:
        """Take a tf2_msgs/TFMessage."""
        for one in message.transforms:
            self._parents[plain(one.child_frame_id)] = plain(one.header.frame_id), _matrix(one.transform)

    def base_of(self, odometry_frame: str, named: str) -> str:
        """The robot's frame: as odometry names it, or else the one whose place in odometry's frame is told.

        Empty: the bag names none.
        """
        children = [frame for frame, (parent, _) in self._parents.items() if parent == odometry_frame]
        if named and (named in self._parents or named in self._all_parents() or not children):
            return named
        return children[0] if children else named

    def _all_parents(self) -> set[str]:
        return {parent for parent, _ in self._parents.values()}

    def mount(self, base: str, sensor: str, odometry_frame: str) -> Mount:
        """Where ``sensor`` sits on ``base``, whichever of the two is the other's ancestor.

        Raises:
            CannotPlaceError: the transforms do not join them, or the sensor is tilted.
        """
        from_sensor, from_base = self._chain(sensor, odometry_frame), self._chain(base, odometry_frame)
        joint = next((frame for frame in from_sensor if frame in from_base), None)
        if joint is None:
            known = ", ".join(sorted(self._parents.keys() | self._all_parents())) or "none"
            raise CannotPlaceError(
                f"the bag has no transform from {base or 'the robot'} to {sensor} (frames: {known})"
            )
        return mount_of(np.linalg.inv(from_base[joint]) @ from_sensor[joint], sensor)

    def _chain(self, frame: str, odometry_frame: str) -> Mapping[str, Matrix]:
        """The frame in itself and in each of its ancestors below odometry's frame, nearest first."""
        chain, placed = {frame: np.eye(4)}, np.eye(4)
        while frame in self._parents:
            frame, parent_from_child = self._parents[frame]
            if frame in chain or frame == odometry_frame:
                break
            placed = parent_from_child @ placed
            chain[frame] = placed
        return chain


def mount_of(base_from_sensor: Matrix, sensor: str) -> Mount:
    """A place in space, seen from above; raises ``CannotPlaceError`` where the sensor's plane is not level."""
    x, y = base_from_sensor[0, 3], base_from_sensor[1, 3]
    up = float(base_from_sensor[2, 2])
    tilt_rad = math.acos(min(1.0, abs(up)))
    if tilt_rad > LEVEL_RAD:
        raise CannotPlaceError(
            f"{sensor} is tilted by {math.degrees(tilt_rad):.0f} degrees: its scans are no plan of the floor "
            f"(expected at most {math.degrees(LEVEL_RAD):.0f})"
        )
    yaw_rad = math.atan2(base_from_sensor[1, 0], base_from_sensor[0, 0])
    return Mount(Pose2D(float(x), float(y), yaw_rad), upside_down=up < 0)


def _matrix(transform: Any) -> Matrix:
    moved, q = transform.translation, transform.rotation
    norm = math.hypot(q.x, q.y, q.z, q.w)
    x, y, z, w = (value / norm for value in (q.x, q.y, q.z, q.w)) if norm > 0 else (0.0, 0.0, 0.0, 1.0)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), moved.x],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), moved.y],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), moved.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
