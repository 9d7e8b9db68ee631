"""The obstacle guard: the robot comes no closer to what a range sensor sees than it can brake for.

Only the part of the motion that shortens a beam is limited. Backing off, turning on the spot and turning away stay
allowed, so the robot is never trapped by what it has stopped for. Wheels that are each asked for a speed of their own
keep their proportions: they are slowed together.

There is a hysteresis: what has brought the robot to a stand lets it go on only when the way is free by a margin
(``release_distance_m``), or else a driver who goes on asking would creep ahead with the noise of the readings.
"""

import math
from collections.abc import Mapping

from pydantic import Field

from chefbotd.core.events import RangeMeasured, RangeStatus
from chefbotd.core.geometry import STANDING, Motion, Pose2D, Twist2D, WheelVelocities
from chefbotd.core.parameters import Parameters, section
from chefbotd.core.record import Record, replace


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
    ``reaction_s`` passes between a reading and the first braking, in addition to the age of the reading. A sensor that
    is silent for longer than ``max_age_s`` counts as a free way, or, where ``silent_is_obstacle``, as an obstacle at
    distance zero. What has brought the robot to a stand, seen by a range sensor or by a lidar, lets it go on from
    ``hysteresis_m`` beyond the distance that it stands for. The default is twice the step of the ultrasonic sensor,
    whose reading of a thing that stands still changes by one step either way, and the noise of a lidar twice over.
    """

    enabled: bool = True
    stop_distance_m: float = Field(default=0.15, ge=0, le=5)
    deceleration_m_s2: float = Field(default=0.5, gt=0, le=100)
    reaction_s: float = Field(default=0.1, ge=0, le=2)
    hysteresis_m: float = Field(default=0.02, ge=0, le=1)
    max_age_s: float = Field(default=0.5, gt=0, le=10)
    silent_is_obstacle: bool = False
    scan: ScanGuardParameters = section()


def later(params: GuardParameters, late_s: float) -> GuardParameters:
    """The same for a board that obeys so much later."""
    return params if late_s == 0 else params.model_copy(update={"reaction_s": params.reaction_s + late_s})


def release_distance_m(params: GuardParameters, stop_distance_m: float) -> float:
    """The distance up to which a robot that has been brought to a stand stands on.

    Rounded, so that the last bit of a sum is not a step of the sensor.
    """
    return round(stop_distance_m + params.hysteresis_m, 9)


class Beam(Record, frozen=True):
    """The last reading of a sensor; infinity is a free way.

    The beam shortens by ``per_linear`` metres for each metre that the robot goes forward, and by ``per_angular_m`` for
    each radian that it turns left. Its distance was measured at ``stamp_s`` and received at ``arrival_s``. One that is
    ``blocked`` has been within the stop distance, and not beyond the release distance since.
    """

    sensor: str
    per_linear: float
    per_angular_m: float
    distance_m: float = math.inf
    stamp_s: float = -math.inf
    arrival_s: float = -math.inf
    blocked: bool = False


Beams = tuple[Beam, ...]


def from_mounts(mounts: Mapping[str, Pose2D]) -> Beams:
    """Beams without a reading, by sensor name; each from its sensor's pose in the base frame (``base_from_sensor``)."""
    return tuple(_mounted(name, pose) for name, pose in mounts.items())


def _mounted(name: str, pose: Pose2D) -> Beam:
    """Rounded, so that the last bit of a cosine does not shorten a beam at a right angle."""
    cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return Beam(name, round(cos, 9), round(pose.x_m * sin - pose.y_m * cos, 9))


def update(params: GuardParameters, beams: Beams, measured: RangeMeasured) -> Beams:
    """The beams with a new reading; a sensor without a mount does not guard."""
    return tuple(
        [_measured(params, beam, measured) if beam.sensor == measured.sensor else beam for beam in beams]
    )


def _measured(params: GuardParameters, beam: Beam, measured: RangeMeasured) -> Beam:
    """With this reading. A sensor that reads nothing nearer than its band stops the robot at the edge of the band."""
    distance_m, stop_m = _distance_m(measured), params.stop_distance_m
    if beam.blocked:
        stop_m = release_distance_m(params, max(stop_m, measured.min_range_m))
    return replace(
        beam,
        distance_m=distance_m,
        stamp_s=measured.stamp_s,
        arrival_s=measured.arrival_s,
        blocked=distance_m <= stop_m,
    )


MAYBE_NEAR = frozenset({RangeStatus.TOO_NEAR, RangeStatus.AMBIGUOUS})


def _distance_m(measured: RangeMeasured) -> float:
    """The distance to use: 0 for what may be near, infinity for what is too far and for no echo."""
    if measured.range_m is not None:
        return measured.range_m
    return 0.0 if measured.status in MAYBE_NEAR else math.inf


def limit(params: GuardParameters, beams: Beams, motion: Motion, now_s: float) -> tuple[Motion, str | None]:
    """The motion that may be driven, and the sensor that it was limited for (None: it is ``wanted``)."""
    if isinstance(motion, WheelVelocities):
        return _limit_wheels(params, beams, motion, now_s)
    return _limit_twist(params, beams, motion, now_s)


def _limit_wheels(
    params: GuardParameters, beams: Beams, motion: WheelVelocities, now_s: float
) -> tuple[WheelVelocities, str | None]:
    share, limiting = 1.0, None
    for beam in beams:
        closing_m_s = _closing_m_s(beam, motion.twist)
        allowed_m_s = _allowed_m_s(params, beam, now_s)
        if closing_m_s * share > allowed_m_s:
            share, limiting = allowed_m_s / closing_m_s, beam.sensor
    return (motion, None) if limiting is None else (motion.slowed(share), limiting)


def _limit_twist(
    params: GuardParameters, beams: Beams, motion: Twist2D, now_s: float
) -> tuple[Twist2D, str | None]:
    """Limit each axis by what it adds to a beam's shortening.

    What shortens one beam less may shorten another more, so there is a second round; if a beam is still too fast after
    it, the robot stands.
    """
    allowed_m_s = [(beam, _allowed_m_s(params, beam, now_s)) for beam in beams]
    twist, limiting = motion, None
    for _ in 1, 2:
        for beam, most_m_s in allowed_m_s:
            if _closing_m_s(beam, twist) > most_m_s:
                twist, limiting = _slowed(beam, twist, most_m_s), beam.sensor
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


def _allowed_m_s(params: GuardParameters, beam: Beam, now_s: float) -> float:
    if now_s - beam.arrival_s > params.max_age_s:
        return 0.0 if params.silent_is_obstacle else math.inf
    if beam.blocked:
        return 0.0
    if beam.distance_m == math.inf:
        return math.inf
    age_s = now_s - beam.stamp_s
    return closing_limit_m_s(params, beam.distance_m, age_s if age_s > 0 else 0.0)


def _closing_m_s(beam: Beam, twist: Twist2D) -> float:
    return beam.per_linear * twist.linear_m_s + beam.per_angular_m * twist.angular_rad_s


def _slowed(beam: Beam, twist: Twist2D, allowed_m_s: float) -> Twist2D:
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
