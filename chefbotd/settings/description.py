"""Reads the robot's description (URDF), and compares it with the configuration, joint by joint.

Read are the positions of its joints in the root link's frame: a wheel is a joint of its configured name; its radius is
that of its link's cylinder, its place that of the joint. Compared are the numbers that can be measured on the robot:
radii, ``track_width_m`` and mounts. The multipliers of a calibration (``track_multiplier``, ``left_radius_multiplier``)
say how its wheels behave, and change no description.
"""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
from urdf_parser_py.urdf import URDF, Cylinder
from urdf_parser_py.xml_reflection.core import ParseError

from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.motion.kinematics import ChassisParameters, Side, WheelParameters
from chefbotd.settings.model import Settings
from chefbotd.settings.mounts import Mount, mounts

Matrix = npt.NDArray[np.float64]


NOT_UNDERSTOOD = (ElementTree.ParseError, ParseError, AssertionError, ValueError, TypeError, AttributeError)
"""The errors that the library raises for bad input; some are accidental, as for a missing attribute."""


class DescriptionError(Exception):
    """A description that cannot be read; its text is ready to be shown."""


class UrdfDescription:
    """The joints of a URDF, with positions and directions in the root link's frame."""

    def __init__(self, path: Path) -> None:
        """Raises ``DescriptionError`` when there is no URDF at this path."""
        try:
            self._model = URDF.from_xml_string(path.read_bytes())
            self._root = self._model.get_root()
        except OSError as error:
            raise DescriptionError(f"{path}: cannot be read: {error.strerror}") from error
        except NOT_UNDERSTOOD as error:
            raise DescriptionError(f"{path}: not a URDF: {_first_line(error)}") from error
        if problem := _problem_of_tree(self._model, self._root):
            raise DescriptionError(f"{path}: not a URDF: {problem}")

    def inertias(self) -> dict[str, tuple[float, Matrix]]:
        """By link: its mass in kg, and its 3 x 3 inertia about its centre of mass in kg m2, where it has any."""
        by_link = {}
        for link in self._model.links:
            if link.inertial is not None:
                inertia = link.inertial.inertia
                tensor = np.zeros((3, 3)) if inertia is None else np.array(inertia.to_matrix(), dtype=float)
                by_link[link.name] = (float(link.inertial.mass), tensor)
        return by_link

    def joints(self) -> dict[str, str]:
        """Every joint with its type (``continuous``, ``fixed``, ...)."""
        return {joint.name: str(joint.type) for joint in self._model.joints}

    def place(self, joint: str) -> tuple[float, float, float]:
        """Where the joint is, in metres."""
        x_m, y_m, z_m = self._base_from(joint)[:3, 3]
        return float(x_m), float(y_m), float(z_m)

    def wheel_names(self) -> list[str]:
        """The joints that turn without end."""
        return [joint.name for joint in self._model.joints if joint.type == "continuous"]

    def joint_type(self, joint: str) -> str | None:
        """A joint's type (``continuous``, ``fixed``, ...); None if no joint has this name."""
        joint_element = self._model.joint_map.get(joint)
        return None if joint_element is None else str(joint_element.type)

    def radius_m(self, wheel: str) -> float | None:
        """The radius of the wheel's cylinder; None where it has none."""
        link = self._model.link_map[self._model.joint_map[wheel].child]
        geometry = link.collision.geometry if link.collision else None
        return float(geometry.radius) if isinstance(geometry, Cylinder) else None

    def axis(self, joint: str) -> tuple[float, float, float]:
        """The direction about which the joint turns (right-handed); URDF's own default is its x axis."""
        own = self._model.joint_map[joint].axis or (1.0, 0.0, 0.0)
        length = math.hypot(*own) or 1.0
        x, y, z = self._base_from(joint)[:3, :3] @ (np.array(own) / length)
        return float(x), float(y), float(z)

    def mount(self, joint: str) -> Pose2D:
        """Where the joint is, seen from above; its heading is where its x axis points."""
        base_from_joint = self._base_from(joint)
        heading_rad = math.atan2(base_from_joint[1, 0], base_from_joint[0, 0])
        return Pose2D(float(base_from_joint[0, 3]), float(base_from_joint[1, 3]), heading_rad)

    def _base_from(self, joint: str) -> Matrix:
        base_from_joint = np.eye(4)
        for name in self._model.get_chain(self._root, self._model.joint_map[joint].child, links=False):
            base_from_joint = base_from_joint @ _transform(self._model.joint_map[name].origin)
        return base_from_joint


def _first_line(error: Exception) -> str:
    if isinstance(error, AttributeError | TypeError):
        return "an element lacks a required attribute"
    return " ".join(str(error).split()) or type(error).__name__


def _problem_of_tree(model: Any, root: str) -> str | None:
    """What is wrong with the tree of links. The library would follow a circle of links for ever."""
    for kind, names in (
        ("links", [link.name for link in model.links]),
        ("joints", [j.name for j in model.joints]),
    ):
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            return f"two {kind} have the name {repeated[0]!r}"
    parents: dict[str, str] = {}
    for joint in model.joints:
        for link in (joint.parent, joint.child):
            if link not in model.link_map:
                return f"joint {joint.name!r} names the link {link!r}, which does not exist"
        if joint.child in parents:
            return f"link {joint.child!r} is the child of two joints"
        parents[joint.child] = joint.parent
    return next(
        (f"link {link!r} is its own ancestor" for link in parents if _is_endless(parents, link, root)), None
    )


def _is_endless(parents: Mapping[str, str], link: str, root: str) -> bool:
    for _ in parents:
        if link == root:
            return False
        link = parents[link]
    return link != root


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


ALLOWED_M = 0.0005
"""The tolerance of lengths: descriptions are written by hand, in millimetres."""

SAME_M = 1e-6
"""What is configured alike is described by the same number."""

ALLOWED_RAD = 0.005
"""The tolerance of angles, a quarter of a degree: they are written by hand as well."""

ALLOWED_SHARE = 0.01
"""The tolerance of moments of inertia, as a share, for a flat disc with rounded numbers."""

LEFTWARDS = (0.0, 1.0, 0.0)
"""A wheel that turns positively about this axis rolls forward, as positive speeds do, whatever its wiring is."""


def differences(description: UrdfDescription, settings: Settings) -> list[str]:
    """The differences of the two, a line each, with the joint, its value and the expected one."""
    return [
        *_bodies(description),
        *_wheels(description, settings.chassis),
        *_sensors(description, settings),
    ]


def _bodies(description: UrdfDescription) -> Iterator[str]:
    """Check that no principal moment of inertia is larger than the sum of the other two."""
    for link, (mass_kg, inertia_kg_m2) in description.inertias().items():
        if not mass_kg > 0:
            yield f"{link}: the mass is {mass_kg:g} kg, expected more than 0"
            continue
        small, middle, large = np.linalg.eigvalsh(inertia_kg_m2)
        if not small > 0 or large > (small + middle) * (1 + ALLOWED_SHARE):
            moments = f"{small:.4g}, {middle:.4g} and {large:.4g} kg m2"
            yield f"{link}: the moments of inertia are {moments}, which no body has: each is less than the others' sum"


def _wheels(description: UrdfDescription, chassis: ChassisParameters) -> Iterator[str]:
    configured = {wheel.name for wheel in chassis.wheels}
    for wheel in chassis.wheels:
        kind = description.joint_type(wheel.name)
        if kind == "continuous":
            yield from _wheel(description, wheel, chassis.track_width_m)
        else:
            problem = "there is no such joint" if kind is None else f"the joint is {kind}"
            yield f"{wheel.name}: {problem}, expected a continuous one, the wheel's"
    yield from _unlike_wheels(description, chassis)
    for name in description.wheel_names():
        if name not in configured:
            yield f"{name}: a continuous joint, expected none: chassis.wheels has no wheel of that name"


def _unlike_wheels(description: UrdfDescription, chassis: ChassisParameters) -> Iterator[str]:
    """Wheels of one radius that are described with two: 0.2 of 35 mm are 1.2 degrees a metre at a track of 0.28 m."""
    first: dict[float, tuple[str, float]] = {}
    for wheel in chassis.wheels:
        described_m = description.radius_m(wheel.name) if description.joint_type(wheel.name) else None
        if described_m is None or _apart(described_m, wheel.radius_m):
            continue
        name, radius_m = first.setdefault(wheel.radius_m, (wheel.name, described_m))
        if _apart(described_m, radius_m, SAME_M):
            yield f"{wheel.name}: the radius is {described_m:g} m, expected {radius_m:g} m as {name}'s: they are equal"


def _wheel(description: UrdfDescription, wheel: WheelParameters, track_width_m: float) -> Iterator[str]:
    radius_m = description.radius_m(wheel.name)
    if radius_m is None:
        yield f"{wheel.name}: its link has no cylinder, expected one with a radius of {wheel.radius_m:g} m"
    elif _apart(radius_m, wheel.radius_m):
        yield f"{wheel.name}: the radius is {radius_m:g} m, expected {wheel.radius_m:g} m (its radius_m)"
    y_m = description.mount(wheel.name).y_m
    expected_m = track_width_m / 2 if wheel.side is Side.LEFT else -track_width_m / 2
    if _apart(y_m, expected_m):
        half = f"half of chassis.track_width_m, to the {wheel.side}"
        yield f"{wheel.name}: y is {y_m:g} m, expected {expected_m:g} m ({half})"
    axis = description.axis(wheel.name)
    if _apart(math.dist(axis, LEFTWARDS), 0.0, ALLOWED_RAD):
        yield f"{wheel.name}: the axis is {_vector(axis)}, expected {_vector(LEFTWARDS)}: forward is positive"


def _sensors(description: UrdfDescription, settings: Settings) -> Iterator[str]:
    for mount in mounts(settings):
        if description.joint_type(mount.joint) is None:
            yield f"{mount.joint}: there is no such joint, expected one for [{mount.section}]"
        else:
            yield from _mount(description.mount(mount.joint), mount)


def _mount(described: Pose2D, mount: Mount) -> Iterator[str]:
    expected = mount.base_from_sensor
    for axis, is_m, be_m in (("x", described.x_m, expected.x_m), ("y", described.y_m, expected.y_m)):
        if mount.placed and _apart(is_m, be_m):
            yield f"{mount.joint}: {axis} is {is_m:g} m, expected {be_m:g} m ({mount.section}.mount_{axis}_m)"
    if _apart(wrap_angle(described.heading_rad - expected.heading_rad), 0.0, ALLOWED_RAD):
        values = f"{described.heading_rad:.4g} rad, expected {expected.heading_rad:.4g} rad"
        yield f"{mount.joint}: the yaw is {values} ({mount.section}.{mount.heading_key})"


def _apart(described: float, expected: float, allowed: float = ALLOWED_M) -> bool:
    """Whether two numbers differ; NaN always does."""
    return not abs(described - expected) <= allowed


def _vector(axis: tuple[float, float, float]) -> str:
    return "(" + ", ".join(f"{round(value, 4) + 0.0:g}" for value in axis) + ")"
