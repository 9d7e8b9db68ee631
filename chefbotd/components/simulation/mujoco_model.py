"""The robot and its surroundings as a MuJoCo model: rigid bodies with soft contacts and Coulomb friction.

All that is not in the configuration is assumed: where the weight is, the caster, the width of the treads, and the
clearance under the body.
"""

import math
from collections.abc import Iterable, Sequence
from xml.etree.ElementTree import Element, SubElement, tostring

from chefbotd.components.simulation.chassis import Chassis
from chefbotd.components.simulation.parameters.floor import FloorKind, FloorParameters
from chefbotd.components.simulation.parameters.motor import GRAVITY_M_S2, MotorParameters, SimBodyParameters
from chefbotd.components.simulation.scene import Scene
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record
from chefbotd.motion.kinematics import places_x_m

MASS_CENTRE_M = 0.06
"""Its height above the floor."""

MASS_BEHIND_SHARE, CASTER_BEHIND_SHARE = 0.22, 0.72
"""Of the body's radius: how far behind the axle the weight of a robot with two wheels is, and its caster."""

CASTER_RADIUS_M, TREAD_M, WHEEL_KG, CLEARANCE_M = 0.02, 0.01, 0.1, 0.03
WALL_M = 0.01
LIFTED_M = 0.1
"""A robot whose wheels hang free is held so high."""

FLOOR_FRICTION = 0.05
"""The friction of a contact is the larger one of both sides, so the floor's must be small."""

CONTACT_S = 0.01
"""The time constant of contacts: a wheel sinks in by a twentieth of a millimetre. Twice the time step is the least."""

PATCH_M = 0.0005
"""A slippery patch is so thick that a wheel does not sink through it to the floor."""

GROUND, SOLID = 1, 2
"""Bits of what collides: wheels meet the ground, the body both."""

SPARE_DISCS = 8
"""Room for things that are put there later."""

FAR_M = -50.0


class Names(Record, frozen=True):
    """What the model's parts are called."""

    base: str = "base"
    solid: str = "solid"
    disc: str = "disc"
    wheel: str = "wheel"


NAMES = Names()


def model_of(
    motor: MotorParameters,
    body: SimBodyParameters,
    chassis: Chassis,
    scene: Scene,
    floor: Sequence[FloorParameters],
    start: Pose2D,
    discs: Iterable[Sequence[float]],
    step_s: float,
) -> str:
    """The model in MuJoCo's XML; ``discs`` are people and things (x, y, radius)."""
    root = Element("mujoco")
    SubElement(root, "compiler", angle="radian")
    SubElement(
        root,
        "option",
        timestep=f"{step_s:.9g}",
        gravity=f"0 0 {-GRAVITY_M_S2}",
        integrator="implicitfast",
        cone="elliptic",
        impratio="10",
    )
    geoms = SubElement(SubElement(root, "default"), "geom")
    geoms.attrib.update(solref=f"{max(CONTACT_S, 2 * step_s):.9g} 1", condim="3")
    world = SubElement(root, "worldbody")
    _add_ground(world, floor)
    _add_walls(world, scene, body.height_m)
    _add_discs(world, discs, body.height_m)
    _add_robot(world, motor, body, chassis, start)
    return tostring(root, encoding="unicode")


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _geom(parent: Element, kind: str, bits: int, **attributes: str) -> Element:
    collides = {"contype": str(bits), "conaffinity": str(bits)}
    return SubElement(parent, "geom", {"type": kind, **collides, **attributes})


def _friction(sliding: float) -> str:
    return _numbers(sliding, 0.0, 0.0)


def _add_ground(world: Element, floor: Sequence[FloorParameters]) -> None:
    _geom(world, "plane", GROUND, size="0 0 1", friction=_friction(FLOOR_FRICTION))
    for part in floor:
        place = SubElement(
            world, "body", pos=_numbers(part.x_m, part.y_m, 0), euler=_numbers(0, 0, part.heading_rad)
        )
        match part.kind:
            case FloorKind.BUMP:
                _add_bump(place, part)
            case FloorKind.RAMP:
                _add_ramp(place, part)
            case FloorKind.SLIPPERY:
                half = _numbers(part.length_m / 2, part.width_m / 2, 0.001)
                _geom(
                    place,
                    "box",
                    GROUND,
                    size=half,
                    pos=_numbers(0, 0, PATCH_M - 0.001),
                    friction=_friction(part.friction),
                    priority="1",
                )


def _add_bump(place: Element, part: FloorParameters) -> None:
    """A sill with a round top across the way: an ellipse ``length_m`` long and ``height_m`` high."""
    size = _numbers(part.length_m / 2, part.width_m / 2, part.height_m)
    _geom(place, "ellipsoid", GROUND, size=size, friction=_friction(FLOOR_FRICTION))


def _add_ramp(place: Element, part: FloorParameters) -> None:
    """Up over a third of its length, level for a third, and down again."""
    third_m, thick_m = part.length_m / 3, 0.05
    slope_rad = math.atan2(part.height_m, third_m)
    long_m = math.hypot(third_m, part.height_m)
    for x_m, z_m, pitch_rad, length_m in (
        (-third_m, part.height_m / 2, -slope_rad, long_m),
        (0.0, part.height_m, 0.0, third_m),
        (third_m, part.height_m / 2, slope_rad, long_m),
    ):
        below_m = thick_m / 2
        pos = _numbers(x_m - below_m * math.sin(pitch_rad), 0, z_m - below_m * math.cos(pitch_rad))
        size = _numbers(length_m / 2, part.width_m / 2, below_m)
        friction = _friction(FLOOR_FRICTION)
        _geom(place, "box", GROUND, size=size, pos=pos, euler=_numbers(0, pitch_rad, 0), friction=friction)


def _add_walls(world: Element, scene: Scene, height_m: float) -> None:
    low = scene.bottom_m < height_m
    rows = zip(
        scene.edges[low].tolist(), scene.bottom_m[low].tolist(), scene.top_m[low].tolist(), strict=True
    )
    for number, ((x1, y1, x2, y2), bottom_m, top_m) in enumerate(rows):
        size = _numbers(math.hypot(x2 - x1, y2 - y1) / 2, WALL_M / 2, (top_m - bottom_m) / 2)
        pos = _numbers((x1 + x2) / 2, (y1 + y2) / 2, (bottom_m + top_m) / 2)
        euler = _numbers(0, 0, math.atan2(y2 - y1, x2 - x1))
        _geom(world, "box", SOLID, name=f"{NAMES.solid}{number}", size=size, pos=pos, euler=euler)


def _add_discs(world: Element, discs: Iterable[Sequence[float]], height_m: float) -> None:
    """Who and what stands about, and room for more, far away: bodies that are put where they are."""
    spare = [(FAR_M, FAR_M, 0.25)] * SPARE_DISCS
    for number, (x_m, y_m, radius_m) in enumerate([*discs, *spare]):
        pos = _numbers(x_m, y_m, height_m / 2)
        disc = SubElement(world, "body", name=f"{NAMES.disc}{number}", mocap="true", pos=pos)
        size = _numbers(radius_m, height_m)
        _geom(disc, "cylinder", SOLID, name=f"{NAMES.disc}{number}", size=size)


def _add_robot(
    world: Element, motor: MotorParameters, body: SimBodyParameters, chassis: Chassis, start: Pose2D
) -> None:
    """A body on its wheels; one with a wheel on each side has a caster behind. Its origin is between the wheels."""
    wheels, lifted = chassis.wheels, not body.mass_kg
    axle_m = sum(wheel.radius_m for wheel in wheels) / len(wheels)
    pos = _numbers(start.x_m, start.y_m, axle_m + (LIFTED_M if lifted else 0.0))
    base = SubElement(world, "body", name=NAMES.base, pos=pos, euler=_numbers(0, 0, start.heading_rad))
    if not lifted:
        SubElement(base, "freejoint")
    has_caster = len(wheels) == 2
    _add_inertia(base, body, chassis, axle_m, -MASS_BEHIND_SHARE * body.radius_m if has_caster else 0.0)
    half_m = (body.height_m - CLEARANCE_M) / 2
    shell = {"size": _numbers(body.radius_m, half_m), "pos": _numbers(0, 0, CLEARANCE_M + half_m - axle_m)}
    bits = SOLID if lifted else GROUND | SOLID  # what stands still would collide with its own wheels
    _geom(base, "cylinder", bits, friction=_friction(FLOOR_FRICTION), mass="0", **shell)
    if has_caster:
        pos = _numbers(-CASTER_BEHIND_SHARE * body.radius_m, 0, CASTER_RADIUS_M - axle_m)
        caster = _geom(base, "sphere", GROUND, size=_numbers(CASTER_RADIUS_M), pos=pos, mass="0")
        caster.attrib.update(friction="0 0 0", priority="2", condim="1")
    places = places_x_m([wheel.is_left for wheel in wheels], body.wheelbase_m)
    for number, (wheel, x_m) in enumerate(zip(wheels, places, strict=True)):
        y_m = chassis.track_width_m / 2 * (1 if wheel.is_left else -1)
        name = f"{NAMES.wheel}{number}"
        on = SubElement(base, "body", pos=_numbers(x_m, y_m, 0))
        SubElement(on, "joint", name=name, axis="0 1 0", armature=_numbers(motor.rotor_inertia_kg_m2))
        tyre = _geom(
            on, "cylinder", GROUND, name=name, size=_numbers(wheel.radius_m, TREAD_M / 2), zaxis="0 1 0"
        )
        tyre.attrib.update(friction=_friction(body.grip), mass=_numbers(WHEEL_KG))


def _add_inertia(
    base: Element, body: SimBodyParameters, chassis: Chassis, axle_m: float, behind_m: float
) -> None:
    """The body's mass without the wheels, as a disc of its radius with the configured yaw inertia."""
    wheels = len(chassis.wheels)
    mass_kg = max(body.mass_kg - wheels * WHEEL_KG, 0.1)
    yaw = max(body.yaw_inertia_kg_m2 - wheels * WHEEL_KG * (chassis.track_width_m / 2) ** 2, 1e-3)
    tilting = yaw / 2 + mass_kg * body.height_m**2 / 12
    pos = _numbers(behind_m, 0, MASS_CENTRE_M - axle_m)
    inertia = _numbers(tilting, tilting, yaw)
    SubElement(base, "inertial", pos=pos, mass=_numbers(mass_kg), diaginertia=inertia)
