"""The robot's description (URDF) held against its configuration.

A wheel is a joint of its configured name; its radius is that of its link's cylinder, its place that of the joint.
"""

import math
from pathlib import Path
from statistics import fmean
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
from urdf_parser_py.urdf import URDF, Cylinder
from urdf_parser_py.xml_reflection.core import ParseError

from chefbotd.motion.kinematics import ChassisParameters, Side, WheelParameters

Matrix = npt.NDArray[np.float64]

ALLOWED_M = 0.0005
"""Descriptions are written by hand, in millimetres."""


class DescriptionError(Exception):
    """A description that cannot be read; its text is ready to be shown."""


class Description:
    """A robot's wheels as its URDF has them."""

    def __init__(self, path: Path) -> None:
        """Raises ``DescriptionError`` when there is no URDF at this path."""
        try:
            self._model = URDF.from_xml_string(path.read_bytes())
            self._root = self._model.get_root()
        except OSError as error:
            raise DescriptionError(f"{path}: cannot be read: {error.strerror}") from error
        except (ElementTree.ParseError, ParseError, AssertionError) as error:
            raise DescriptionError(f"{path}: not a URDF: {error}") from error

    def wheel_names(self) -> list[str]:
        """The joints that turn without end."""
        return [joint.name for joint in self._model.joints if joint.type == "continuous"]

    def radius_m(self, wheel: str) -> float | None:
        """The radius of the wheel's cylinder; None where it has none."""
        link = self._model.link_map[self._model.joint_map[wheel].child]
        geometry = link.collision.geometry if link.collision else None
        return float(geometry.radius) if isinstance(geometry, Cylinder) else None

    def left_m(self, wheel: str) -> float:
        """How far left of the robot's middle line the wheel stands, in the root link's frame."""
        base_from_wheel = np.eye(4)
        child = self._model.joint_map[wheel].child
        for name in self._model.get_chain(self._root, child, links=False):
            base_from_wheel = base_from_wheel @ _transform(self._model.joint_map[name].origin)
        return float(base_from_wheel[1, 3])


def _transform(origin: Any) -> Matrix:
    """A joint's 4 x 4 ``parent_from_child``: fixed axes, roll then pitch then yaw; None is the identity."""
    transform = np.eye(4)
    if origin is None:
        return transform
    roll, pitch, yaw = origin.rpy or (0.0, 0.0, 0.0)
    transform[:3, :3] = _about(2, yaw) @ _about(1, pitch) @ _about(0, roll)
    transform[:3, 3] = origin.xyz or (0.0, 0.0, 0.0)
    return transform


def _about(axis: int, angle_rad: float) -> Matrix:
    """The rotation about one of the axes x, y, z."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[a, a] = rotation[b, b] = math.cos(angle_rad)
    rotation[b, a] = math.sin(angle_rad)
    rotation[a, b] = -rotation[b, a]
    return rotation


def differences(description: Description, chassis: ChassisParameters) -> list[str]:
    """What the description and the configuration do not agree on, each with both values; nothing when they agree."""
    described, configured = set(description.wheel_names()), {wheel.name for wheel in chassis.wheels}
    if described != configured:
        names = f"{_listed(described)}, the configuration {_listed(configured)}"
        return [f"the description has the wheels {names}"]
    radii = [found for wheel in chassis.wheels if (found := _radius_difference(description, wheel))]
    return radii + _track_difference(description, chassis)


def _listed(names: set[str]) -> str:
    return ", ".join(sorted(names)) or "none"


def _radius_difference(description: Description, wheel: WheelParameters) -> str | None:
    radius_m = description.radius_m(wheel.name)
    if radius_m is not None and abs(radius_m - wheel.radius_m) <= ALLOWED_M:
        return None
    has = "has no cylinder" if radius_m is None else f"has a radius of {radius_m:g} m"
    return f"{wheel.name} {has} in the description, {wheel.radius_m:g} m in the configuration"


def _track_difference(description: Description, chassis: ChassisParameters) -> list[str]:
    sides = {
        side: fmean(description.left_m(wheel.name) for wheel in chassis.wheels if wheel.side is side)
        for side in Side
    }
    track_m = sides[Side.LEFT] - sides[Side.RIGHT]
    if abs(track_m - chassis.track_width_m) <= ALLOWED_M:
        return []
    return [
        f"left and right wheels are {track_m:g} m apart in the description, "
        f"track_width_m is {chassis.track_width_m:g} m in the configuration"
    ]
