"""The robot's URDF, made from its configuration: links, joints, sensors, and masses where they are known.

Frames follow REP-103 and REP-105: ``base_footprint`` on the floor, ``base_link`` above it at the height of the axles,
x forward, y left. A wheel's joint has the wheel's name and turns about the y axis, so that forward is positive.
"""

import math
from xml.etree import ElementTree

from chefbotd.motion.kinematics import Side, WheelParameters, places_x_m
from chefbotd.settings.model import BodyParameters, Settings
from chefbotd.settings.mounts import mounts

Element = ElementTree.Element
SubElement = ElementTree.SubElement

ROUNDING = 1e-12
"""The rounding error in the difference of two equal numbers."""

NOTE = """
Made by chefbotd from the robot's configuration. The daemon makes it anew at every start and serves that, so changes
here change nothing. To use a URDF of your own, name it in the configuration: [robot] description = "my.urdf".
"""


def urdf_of(settings: Settings) -> str:
    """The URDF document of the configured robot; the same configuration gives the same text."""
    chassis, body = settings.chassis, settings.body
    axle_height_m = chassis.wheels[0].radius_m
    robot = Element("robot", name=settings.robot.name)
    robot.append(ElementTree.Comment(NOTE))
    SubElement(robot, "link", name="base_footprint")
    _fixed_joint(robot, "base_joint", "base_footprint", "base_link", (0.0, 0.0, axle_height_m))
    base = SubElement(robot, "link", name="base_link")
    if body is not None:
        _add_body(base, body, axle_height_m)
    sides = [wheel.side is Side.LEFT for wheel in chassis.wheels]
    for wheel, x_m in zip(chassis.wheels, places_x_m(sides, settings.wheelbase_m), strict=True):
        y_m = chassis.track_width_m / 2 if wheel.side is Side.LEFT else -chassis.track_width_m / 2
        _add_wheel(robot, wheel, (x_m, y_m, wheel.radius_m - axle_height_m), body)
    for mount in mounts(settings):
        link, pose = mount.joint.removesuffix("_joint") + "_link", mount.base_from_sensor
        height_m = axle_height_m if mount.height_m is None else mount.height_m
        xyz = (pose.x_m, pose.y_m, height_m - axle_height_m)
        rpy = (math.pi if mount.upside_down else 0.0, 0.0, pose.heading_rad)
        _fixed_joint(robot, mount.joint, "base_link", link, xyz, rpy=rpy)
        SubElement(robot, "link", name=link)
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"


Vector = tuple[float, float, float]


def _add_body(link: Element, body: BodyParameters, axle_height_m: float) -> None:
    centre = (0.0, 0.0, body.ground_clearance_m + body.height_m / 2 - axle_height_m)
    shape: tuple[str, dict[str, str]]
    if body.width_m is None:
        radius_m = body.length_m / 2
        shape = ("cylinder", {"radius": _number(radius_m), "length": _number(body.height_m)})
        across, along = _cylinder_inertia(radius_m, body.height_m)
        per_kg = (across, across, along)
    else:
        sides_m = (body.length_m, body.width_m, body.height_m)
        shape = ("box", {"size": _numbers(sides_m)})
        x2, y2, z2 = (side_m**2 / 12 for side_m in sides_m)
        per_kg = (y2 + z2, x2 + z2, x2 + y2)
    if body.mass_kg is not None:
        _add_inertial(link, body.mass_kg, per_kg, {"xyz": _numbers(centre)})
    _add_shape(link, shape, {"xyz": _numbers(centre)})


def _add_wheel(robot: Element, wheel: WheelParameters, xyz: Vector, body: BodyParameters | None) -> None:
    joint = SubElement(robot, "joint", name=wheel.name, type="continuous")
    SubElement(joint, "parent", link="base_link")
    SubElement(joint, "child", link=f"{wheel.name}_link")
    SubElement(joint, "origin", xyz=_numbers(xyz))
    SubElement(joint, "axis", xyz="0 1 0")
    link = SubElement(robot, "link", name=f"{wheel.name}_link")
    width_m = BodyParameters.model_fields["wheel_width_m"].default if body is None else body.wheel_width_m
    if body is not None and body.wheel_mass_kg is not None:
        across, along = _cylinder_inertia(wheel.radius_m, width_m)
        _add_inertial(link, body.wheel_mass_kg, (across, along, across), {})
    size = {"radius": _number(wheel.radius_m), "length": _number(width_m)}
    lying = {"rpy": _numbers((math.pi / 2, 0.0, 0.0))}  # a cylinder of URDF stands along z
    _add_shape(link, ("cylinder", size), lying)


def _cylinder_inertia(radius_m: float, length_m: float) -> tuple[float, float]:
    """The moments of inertia of a cylinder of one kilogram, across its axis and about it, in kg m2."""
    return (3 * radius_m**2 + length_m**2) / 12, radius_m**2 / 2


def _fixed_joint(
    robot: Element, name: str, parent: str, child: str, xyz: Vector, *, rpy: Vector = (0.0, 0.0, 0.0)
) -> None:
    joint = SubElement(robot, "joint", name=name, type="fixed")
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    turned = {"rpy": _numbers(rpy)} if any(rpy) else {}
    SubElement(joint, "origin", {"xyz": _numbers(xyz), **turned})


def _add_inertial(link: Element, mass_kg: float, per_kg: Vector, origin: dict[str, str]) -> None:
    inertial = SubElement(link, "inertial")
    if origin:
        SubElement(inertial, "origin", origin)
    SubElement(inertial, "mass", value=_number(mass_kg))
    ixx, iyy, izz = (_number(mass_kg * value) for value in per_kg)
    SubElement(inertial, "inertia", ixx=ixx, ixy="0", ixz="0", iyy=iyy, iyz="0", izz=izz)


def _add_shape(link: Element, shape: tuple[str, dict[str, str]], origin: dict[str, str]) -> None:
    for use in ("visual", "collision"):
        element = SubElement(link, use)
        SubElement(element, "origin", origin)
        SubElement(SubElement(element, "geometry"), *shape)


def _number(value: float) -> str:
    return f"{value:.9g}" if abs(value) > ROUNDING else "0"


def _numbers(values: Vector) -> str:
    return " ".join(map(_number, values))
