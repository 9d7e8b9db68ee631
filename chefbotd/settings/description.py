"""Reads the robot's description (URDF): the positions of its joints in the root link's frame.

A wheel is a joint of its configured name; its radius is that of its link's cylinder, its place that of the joint.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
from urdf_parser_py.urdf import URDF, Cylinder
from urdf_parser_py.xml_reflection.core import ParseError

from chefbotd.core.geometry import Pose2D

Matrix = npt.NDArray[np.float64]


NOT_UNDERSTOOD = (ElementTree.ParseError, ParseError, AssertionError, ValueError, TypeError, AttributeError)
"""What the library raises for bad input: some of it, such as an element without its attribute, by stumbling over it."""


class DescriptionError(Exception):
    """A description that cannot be read; its text is ready to be shown."""


class Description:
    """A robot's joints as its URDF has them; places and directions are those in the root link's frame."""

    def __init__(self, path: Path) -> None:
        """Raises ``DescriptionError`` when there is no URDF at this path."""
        try:
            self._model = URDF.from_xml_string(path.read_bytes())
            self._root = self._model.get_root()
        except OSError as error:
            raise DescriptionError(f"{path}: cannot be read: {error.strerror}") from error
        except NOT_UNDERSTOOD as error:
            raise DescriptionError(f"{path}: not a URDF: {_told(error)}") from error
        if problem := _problem_of_tree(self._model, self._root):
            raise DescriptionError(f"{path}: not a URDF: {problem}")

    def inertias(self) -> dict[str, tuple[float, Matrix]]:
        """By link: its mass in kg, and its 3 x 3 inertia about its centre of mass in kg m2, where it has any."""
        found = {}
        for link in self._model.links:
            if link.inertial is not None:
                inertia = link.inertial.inertia
                tensor = np.zeros((3, 3)) if inertia is None else np.array(inertia.to_matrix(), dtype=float)
                found[link.name] = (float(link.inertial.mass), tensor)
        return found

    def joints(self) -> dict[str, str]:
        """Every joint with what it is (``continuous``, ``fixed``, ...)."""
        return {joint.name: str(joint.type) for joint in self._model.joints}

    def place(self, joint: str) -> tuple[float, float, float]:
        """Where the joint is, in metres."""
        x_m, y_m, z_m = self._base_from(joint)[:3, 3]
        return float(x_m), float(y_m), float(z_m)

    def wheel_names(self) -> list[str]:
        """The joints that turn without end."""
        return [joint.name for joint in self._model.joints if joint.type == "continuous"]

    def joint_type(self, joint: str) -> str | None:
        """What a joint is (``continuous``, ``fixed``, ...); None where there is none of that name."""
        found = self._model.joint_map.get(joint)
        return None if found is None else str(found.type)

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


def _told(error: Exception) -> str:
    if isinstance(error, AttributeError | TypeError):
        return "an element lacks a required attribute"
    return " ".join(str(error).split()) or type(error).__name__


def _problem_of_tree(model: Any, root: str) -> str | None:
    """What keeps the joints from being one tree of links; the library would go round in a circle of them for ever."""
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
