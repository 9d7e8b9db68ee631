"""The obstacle guard: the robot comes no closer to what a range sensor sees than it can brake for.

Only the part of the motion that shortens a beam is limited. Backing off, turning on the spot and turning away stay
allowed, so the robot is never trapped by what it has stopped for. Wheels that are each asked for a speed of their own
keep their proportions: they are slowed together.

There is a hysteresis: what has brought the robot to a stand lets it go on only when the way is free by a margin
(``release_distance_m``), or else a driver who goes on asking would creep ahead with the noise of the readings.
"""

import math
from collections.abc import Callable, Mapping
from typing import TypeAlias

from pydantic import Field

from chefbotd.core.events import RangeMeasured, RangeStatus
from chefbotd.core.geometry import STANDING, Motion, Pose2D, Twist2D, WheelVelocities
from chefbotd.core.parameters import Parameters, section
from chefbotd.core.record import Record
from chefbotd.safety import range_memory
from chefbotd.safety.encoder_timeout import OBEYS_AFTER_S, OVERSHOOT, WAIT_S
from chefbotd.safety.range_memory import NOTHING, Believed, RangeMemoryParameters


class ScanGuardParameters(Parameters):
    """How the robot keeps away from what lidars see, measured from its outline (``chefbotd.safety.scan_guard``).

    It stops ``stop_distance_m`` before what is in its way, and passes what is at least ``clearance_m`` beside it. Its
    turning brakes with at least ``turn_deceleration_rad_s2``, which must not exceed what the motion limits allow.
    Without a scan for ``max_age_s`` of the guard, no part of the robot moves faster than ``silent_speed_m_s`` (0: it
    stands).
    """

    stop_distance_m: float = Field(default=0.05, ge=0, le=5)
    clearance_m: float = Field(default=0.02, ge=0, le=1)
    turn_deceleration_rad_s2: float = Field(default=1.0, gt=0, le=100)
    silent_speed_m_s: float = Field(default=0.1, ge=0, le=10)


class GuardParameters(Parameters):
    """The stop distance, measured from the sensor, and how the robot brakes before it.

    ``deceleration_m_s2`` must not exceed what the motion limits allow: the configuration is refused otherwise.
    ``reaction_s`` passes between a reading and the first braking, in addition to the age of the reading. ``memory`` says
    when what a range sensor saw is gone. A sensor that is silent for longer than ``max_age_s`` still sees what it saw
    last, until the robot has turned or driven away from it; where that was nothing, it counts as a free way. With
    ``silent_is_obstacle`` it is an obstacle at distance zero, and so is one that hears no echo for so long: one that is
    unplugged hears none either.

    What has brought the robot to a stand, seen by a range sensor or by a lidar, lets it go on from ``hysteresis_m``
    beyond the distance that it stands for. The default is twice the step of the ultrasonic sensor, whose reading of a
    thing that stands still changes by one step either way, and the noise of a lidar twice over.
    """

    enabled: bool = True
    """The obstacle guard slows what brings the robot closer to what a sensor sees."""
    stop_distance_m: float = Field(default=0.15, ge=0, le=5)
    """The distance from a range sensor at which the robot stands."""
    deceleration_m_s2: float = Field(default=0.5, gt=0, le=100)
    """The braking that the guard counts on; it must not exceed what the motion limits allow."""
    reaction_s: float = Field(default=0.1, ge=0, le=2)
    hysteresis_m: float = Field(default=0.02, ge=0, le=1)
    """A robot that the guard has stopped stands until there is so much more room."""
    max_age_s: float = Field(default=0.5, gt=0, le=10)
    """A sensor that is silent for longer counts as silent: it still sees what it saw last."""
    silent_is_obstacle: bool = False
    """A silent sensor, and one that hears no echo, count as an obstacle at distance zero."""
    memory: RangeMemoryParameters = section()
    scan: ScanGuardParameters = section()


def later(params: GuardParameters, late_s: float) -> GuardParameters:
    """The same for a board that obeys so much later."""
    return params if late_s == 0 else params.model_copy(update={"reaction_s": params.reaction_s + late_s})


def release_distance_m(params: GuardParameters, stop_distance_m: float) -> float:
    """The distance up to which a robot that has been brought to a stand stands on.

    Rounded, so that the last bit of a sum is not a step of the sensor.
    """
    return round(stop_distance_m + params.hysteresis_m, 9)


WheelAngles: TypeAlias = tuple[float, ...]

Moved: TypeAlias = Callable[[WheelAngles], tuple[float, float]]
"""How far the robot has come since its wheels stood so: metres ahead, and radians to the left."""

MISSES_REMEMBERED = 0.3
"""A sensor whose faded count of misses is above this may miss again."""


def stands_still(_: WheelAngles) -> tuple[float, float]:
    """Where nothing is known of the wheels, the robot has not moved."""
    return 0.0, 0.0


class Beam(Record, frozen=True):
    """What a sensor is believed to see; infinity is a free way.

    The beam shortens by ``per_linear`` metres for each metre that the robot goes forward, and by ``per_angular_m`` for
    each radian that it turns left. Its distance is that of ``stamp_s``, when the wheels stood at ``wheels_rad``. The
    last reading was received at ``arrival_s``, the last one with an echo at ``echo_s``. One that is ``blocked`` has
    been within the stop distance, and not beyond the release distance since. The board is silent at a miss of a sensor
    that ``silences_board``.
    """

    sensor: str
    per_linear: float
    per_angular_m: float
    distance_m: float = math.inf
    stamp_s: float = -math.inf
    arrival_s: float = -math.inf
    blocked: bool = False
    echo_s: float = -math.inf
    wheels_rad: WheelAngles = ()
    believed: Believed = NOTHING
    field_of_view_rad: float = 0.0
    silences_board: bool = False


Beams = tuple[Beam, ...]


def from_mounts(mounts: Mapping[str, Pose2D]) -> Beams:
    """Beams without a reading, by sensor name; each from its sensor's pose in the base frame (``base_from_sensor``)."""
    return tuple(_mount_beam(name, pose) for name, pose in mounts.items())


def _mount_beam(name: str, pose: Pose2D) -> Beam:
    """Rounded, so that the last bit of a cosine does not shorten a beam at a right angle."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return Beam(name, round(cos, 9), round(pose.x_m * sin - pose.y_m * cos, 9))


def update(
    params: GuardParameters,
    beams: Beams,
    measured: RangeMeasured,
    wheels_rad: WheelAngles = (),
    wheels_s: float = -math.inf,
    moved: Moved = stands_still,
) -> Beams:
    """The beams with a new reading; a sensor without a mount does not guard.

    The wheels stood at ``wheels_rad`` at ``wheels_s``, and have ``moved`` the robot so far since.
    """
    for index, beam in enumerate(beams):
        if beam.sensor == measured.sensor:
            read = _measure_beam(params, beam, measured, wheels_rad, wheels_s, moved)
            if len(beams) == 1:
                return (read,)
            return (*beams[:index], read, *beams[index + 1 :])
    return beams


def _measure_beam(
    params: GuardParameters,
    beam: Beam,
    measured: RangeMeasured,
    wheels_rad: WheelAngles,
    wheels_s: float,
    moved: Moved,
) -> Beam:
    """With this reading. A sensor that reads nothing nearer than its band stops the robot at the edge of the band."""
    distance_m, stop_m, status = measured.range_m, params.stop_distance_m, measured.status
    if distance_m is None:  # 0 for what may be near, infinity for what is too far and for no echo
        distance_m = 0.0 if status in MAYBE_NEAR else math.inf
    if beam.blocked:
        stop_m = release_distance_m(params, max(stop_m, measured.min_range_m))
    before, shortened_m, turned_rad = beam.believed, 0.0, 0.0
    if beam.wheels_rad and not (before.distance_m == math.inf == before.gone_m):
        ahead_m, turned_rad = moved(beam.wheels_rad)
        shortened_m = beam.per_linear * ahead_m + beam.per_angular_m * turned_rad
    believed = range_memory.add_reading(
        params.memory,
        before,
        distance_m,
        shortened_m,
        turned_rad,
        stand_m=stop_m,
        hysteresis_m=params.hysteresis_m,
        max_range_m=measured.max_range_m,
        field_of_view_rad=measured.field_of_view_rad,
    )
    is_echo, arrival_s = status is not RangeStatus.NO_ECHO, measured.arrival_s
    waited = not is_echo and params.max_age_s < arrival_s - beam.arrival_s <= WAIT_S
    return Beam(
        beam.sensor,
        beam.per_linear,
        beam.per_angular_m,
        believed.distance_m,
        # what was not seen now is where the wheels have brought it
        measured.stamp_s
        if believed.distance_m == distance_m or not wheels_rad
        else min(measured.stamp_s, wheels_s),
        arrival_s,
        believed.distance_m <= stop_m,
        arrival_s if is_echo else beam.echo_s,
        wheels_rad,
        believed,
        measured.field_of_view_rad,
        waited or (beam.silences_board and believed.missed > MISSES_REMEMBERED),
    )


MAYBE_NEAR = frozenset({RangeStatus.TOO_NEAR, RangeStatus.AMBIGUOUS})


def limit(
    params: GuardParameters,
    beams: Beams,
    motion: Motion,
    now_s: float,
    *,
    late_s: float = 0.0,
    moved: Moved = stands_still,
) -> tuple[Motion, str | None]:
    """The motion that may be driven, and the sensor that it was limited for (None: it is ``wanted``).

    The board obeys ``late_s`` later than usual. ``moved`` is how the wheels have moved the robot.
    """
    allowed_m_s: Allowed = []
    for beam in beams:
        allowed_m_s.append((beam, _allowed_m_s(params, beam, now_s, late_s, moved)))
    if isinstance(motion, WheelVelocities):
        return _limit_wheels(allowed_m_s, motion)
    return _limit_twist(allowed_m_s, motion)


Allowed: TypeAlias = list[tuple[Beam, float]]
"""The beams, and how fast each may be shortened."""


def _limit_wheels(allowed_m_s: Allowed, motion: WheelVelocities) -> tuple[WheelVelocities, str | None]:
    share, limiting = 1.0, None
    for beam, most_m_s in allowed_m_s:
        closing_m_s = _closing_m_s(beam, motion.twist)
        if closing_m_s * share > most_m_s:
            share, limiting = most_m_s / closing_m_s, beam.sensor
    return (motion, None) if limiting is None else (motion.slowed(share), limiting)


def _limit_twist(allowed_m_s: Allowed, motion: Twist2D) -> tuple[Twist2D, str | None]:
    """Limit each axis by what it adds to a beam's shortening.

    What shortens one beam less may shorten another more, so there is a second round; if a beam is still too fast after
    it, the robot stands.
    """
    twist, limiting = motion, None
    for _ in 1, 2:
        for beam, most_m_s in allowed_m_s:
            if _closing_m_s(beam, twist) > most_m_s:
                twist, limiting = _slow_twist(beam, twist, most_m_s), beam.sensor
        if limiting is None:
            return motion, None
    if any(_closing_m_s(beam, twist) > most_m_s + 1e-9 for beam, most_m_s in allowed_m_s):
        return STANDING, limiting
    return twist, limiting


def closing_limit_m_s(params: GuardParameters, distance_m: float, age_s: float) -> float:
    """The speed from which the robot comes to rest at the stop distance: ``v t + v^2 / 2a = distance - stop``."""
    room_m = distance_m - params.stop_distance_m
    if room_m <= 0:
        return 0.0
    delay_s, braking = params.reaction_s + age_s, params.deceleration_m_s2
    return braking * (math.sqrt(delay_s * delay_s + 2 * room_m / braking) - delay_s)


def _allowed_m_s(params: GuardParameters, beam: Beam, now_s: float, late_s: float, moved: Moved) -> float:
    """How fast the beam may be shortened now."""
    is_silent = now_s - beam.arrival_s > params.max_age_s
    if params.silent_is_obstacle and (is_silent or now_s - beam.echo_s > params.max_age_s):
        return 0.0
    distance_m = beam.distance_m
    if distance_m == math.inf:
        return math.inf
    if beam.blocked and not is_silent:
        return 0.0
    age_s = now_s - beam.stamp_s
    if is_silent:  # what it saw last is where the wheels have brought it
        distance_m, age_s = _remembered_m(params, beam, moved), 0.0
    if beam.silences_board and late_s < LATE_S:
        late_s = LATE_S
    return closing_limit_m_s(params, distance_m, (age_s if age_s > 0 else 0.0) + late_s)


LATE_S = OVERSHOOT * OBEYS_AFTER_S
"""Where a miss silences the board, any cycle may be the one in which it obeys so late."""


def _remembered_m(params: GuardParameters, beam: Beam, moved: Moved) -> float:
    """How far away is what a silent sensor saw last; infinity once the robot has turned away from it."""
    ahead_m, turned_rad = moved(beam.wheels_rad) if beam.wheels_rad else (0.0, 0.0)
    if abs(beam.believed.turned_rad + turned_rad) > beam.field_of_view_rad:
        return math.inf
    distance_m = beam.distance_m - beam.per_linear * ahead_m - beam.per_angular_m * turned_rad
    is_held = beam.blocked and distance_m <= release_distance_m(params, params.stop_distance_m)
    return 0.0 if is_held else distance_m


def _closing_m_s(beam: Beam, twist: Twist2D) -> float:
    return beam.per_linear * twist.linear_m_s + beam.per_angular_m * twist.angular_rad_s


def _slow_twist(beam: Beam, twist: Twist2D, allowed_m_s: float) -> Twist2D:
    """First slow the part of the driving that closes in, then, if that is not enough, the turning."""
    driving_m_s = beam.per_linear * twist.linear_m_s
    turning_m_s = beam.per_angular_m * twist.angular_rad_s
    linear_m_s, angular_rad_s = twist.linear_m_s, twist.angular_rad_s
    if driving_m_s > 0:
        driving_m_s = max(0.0, min(driving_m_s, allowed_m_s - turning_m_s))
        linear_m_s = driving_m_s / beam.per_linear
    if turning_m_s > allowed_m_s - driving_m_s and turning_m_s > 0:
        angular_rad_s = max(0.0, allowed_m_s - driving_m_s) / beam.per_angular_m
    return Twist2D(linear_m_s, angular_rad_s)
