"""The robot's description held against its configuration, joint by joint, and against what a body can be.

Compared are the numbers that can be measured on the robot: radii, ``track_width_m`` and mounts. The multipliers of a
calibration (``track_multiplier``, ``left_radius_multiplier``) say how its wheels behave, and change no description.
"""

import math
from collections.abc import Iterator

import numpy as np

from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.motion.kinematics import ChassisParameters, Side, WheelParameters
from chefbotd.settings.description import Description
from chefbotd.settings.model import Settings
from chefbotd.settings.mounts import Mount, mounts

ALLOWED_M = 0.0005
"""Descriptions are written by hand, in millimetres."""

ALLOWED_RAD = 0.005
"""A quarter of a degree: angles are written by hand as well."""

ALLOWED_SHARE = 0.01
"""Of the moments of inertia, for a flat disc whose numbers were rounded."""

LEFTWARDS = (0.0, 1.0, 0.0)
"""A wheel that turns positively about this axis rolls forward, as positive speeds do, whatever its wiring is."""


def differences(description: Description, settings: Settings) -> list[str]:
    """What the two do not agree on: a line each, with the joint, the value found and the one expected."""
    return [
        *_bodies(description),
        *_wheels(description, settings.chassis),
        *_sensors(description, settings),
    ]


def _bodies(description: Description) -> Iterator[str]:
    """Of the three principal moments none is larger than the two others together: they share the same mass."""
    for link, (mass_kg, inertia_kg_m2) in description.inertias().items():
        if not mass_kg > 0:
            yield f"{link}: the mass is {mass_kg:g} kg, expected more than 0"
            continue
        small, middle, large = np.linalg.eigvalsh(inertia_kg_m2)
        if not small > 0 or large > (small + middle) * (1 + ALLOWED_SHARE):
            moments = f"{small:.4g}, {middle:.4g} and {large:.4g} kg m2"
            yield f"{link}: the moments of inertia are {moments}, which no body has: each is less than the others' sum"


def _wheels(description: Description, chassis: ChassisParameters) -> Iterator[str]:
    configured = {wheel.name for wheel in chassis.wheels}
    for wheel in chassis.wheels:
        kind = description.joint_type(wheel.name)
        if kind == "continuous":
            yield from _wheel(description, wheel, chassis.track_width_m)
        else:
            found = "there is no such joint" if kind is None else f"the joint is {kind}"
            yield f"{wheel.name}: {found}, expected a continuous one, the wheel's"
    for name in description.wheel_names():
        if name not in configured:
            yield f"{name}: a continuous joint, expected none: chassis.wheels has no wheel of that name"


def _wheel(description: Description, wheel: WheelParameters, track_width_m: float) -> Iterator[str]:
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


def _sensors(description: Description, settings: Settings) -> Iterator[str]:
    for mount in mounts(settings):
        if description.joint_type(mount.joint) is None:
            yield f"{mount.joint}: there is no such joint, expected one for [{mount.section}]"
        else:
            yield from _mount(description.mount(mount.joint), mount)


def _mount(found: Pose2D, mount: Mount) -> Iterator[str]:
    expected = mount.base_from_sensor
    for axis, is_m, be_m in (("x", found.x_m, expected.x_m), ("y", found.y_m, expected.y_m)):
        if mount.placed and _apart(is_m, be_m):
            yield f"{mount.joint}: {axis} is {is_m:g} m, expected {be_m:g} m ({mount.section}.mount_{axis}_m)"
    if _apart(wrap_angle(found.heading_rad - expected.heading_rad), 0.0, ALLOWED_RAD):
        values = f"{found.heading_rad:.4g} rad, expected {expected.heading_rad:.4g} rad"
        yield f"{mount.joint}: the yaw is {values} ({mount.section}.{mount.heading_key})"


def _apart(found: float, expected: float, allowed: float = ALLOWED_M) -> bool:
    """Whether they differ; what is no number does."""
    return not abs(found - expected) <= allowed


def _vector(axis: tuple[float, float, float]) -> str:
    return "(" + ", ".join(f"{round(value, 4) + 0.0:g}" for value in axis) + ")"
