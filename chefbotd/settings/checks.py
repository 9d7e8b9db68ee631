"""Checks between the sections of a configuration: each may be valid alone and not fit the others."""

import math
import os
from collections.abc import Iterator

from chefbotd.component_list import own_components
from chefbotd.link.wires import BITS_A_BYTE, Needs, needed_bytes_s, variant_of, wires
from chefbotd.motion.kinematics import ALL_WHEELS, Kinematics
from chefbotd.motion.odometry import OdometrySource
from chefbotd.motion.ramp import braking_distance
from chefbotd.rpc.parameters import is_loopback
from chefbotd.safety.guard import from_mounts
from chefbotd.settings.model import Settings
from chefbotd.settings.mounts import joint_names
from chefbotd.settings.sections import check_components, check_strangers


def check(settings: Settings) -> Iterator[str]:
    """A message for everything that does not fit together, with the values."""
    yield from _wheels(settings)
    yield from _wheel_loop(settings)
    yield from _lines(settings)
    yield from _load(settings)
    yield from _duty(settings)
    yield from _odometry(settings)
    yield from _names(settings)
    yield from _lidars(settings)
    yield from _guard(settings)
    yield from _braking(settings)
    yield from _turning(settings)
    yield from _nearest(settings)
    yield from _page(settings)
    yield from check_components(settings, own_components())
    yield from check_strangers(settings)


def _wheels(settings: Settings) -> Iterator[str]:
    wire = settings.robot.wire
    wheels, named = variant_of(wire).wheels, len(settings.chassis.wheels)
    if wheels != named:
        yield f"the wire {wire!r} has {wheels} wheels, the chassis names {named}"
    if any(wheel.name == ALL_WHEELS for wheel in settings.chassis.wheels):
        yield f"no wheel can be named {ALL_WHEELS!r}: set_pid uses it for every wheel"


def _wheel_loop(settings: Settings) -> Iterator[str]:
    differ = [wheel.name for wheel in settings.chassis.wheels if wheel.motor_sign != wheel.encoder_sign]
    if settings.link.wheel_loop and differ:
        yield f"[link] wheel_loop needs a motor_sign like the encoder_sign of each wheel, unlike that of {differ[0]!r}"


def _odometry(settings: Settings) -> Iterator[str]:
    source = settings.odometry.source
    if source is OdometrySource.WHEELS_IMU and settings.imu is None:
        yield f"[odometry] source = {str(source)!r} needs the section [imu]"


def _lines(settings: Settings) -> Iterator[str]:
    """Refuse a section for a sensor that the board never reports: it would be silent for ever."""
    needs = {
        "[ultrasonic]": (settings.ultrasonic is not None, Needs.ULTRASONIC),
        "[[infrared]] " + " ".join(sensor.name for sensor in settings.infrared): (
            bool(settings.infrared),
            Needs.INFRARED,
        ),
        "[imu]": (settings.imu is not None, Needs.IMU),
        "[quadrature]": ("quadrature" in settings.model_fields_set, Needs.QUADRATURE),
    }
    for section, (is_there, line) in needs.items():
        if is_there and settings.robot.wire not in wires(line):
            yield (
                f"{section} needs a line that the wire {settings.robot.wire!r} does not have; "
                f"those with one: {', '.join(wires(line))}"
            )


def _load(settings: Settings) -> Iterator[str]:
    """Every edge must fit the line at the highest speed that a wheel is driven at."""
    variant, capacity = variant_of(settings.robot.wire), settings.link.baud // BITS_A_BYTE
    if variant.name not in wires(Needs.QUADRATURE) or variant.wheels != len(settings.chassis.wheels):
        return
    rim_m_s, counts = settings.drive.max_rim_speed_m_s, settings.encoders.counts_per_turn
    wheels_rad_s = [rim_m_s / radius_m for radius_m in Kinematics(settings.chassis).radii_m]
    needed = needed_bytes_s(
        variant.name,
        [wheel_rad_s * counts / math.tau for wheel_rad_s in wheels_rad_s],
        analogue_inputs=len(settings.infrared),
        ultrasonic=settings.ultrasonic is not None,
        imu=settings.imu is not None,
    )
    if needed > capacity:
        yield (
            f"the wire {variant.name!r} cannot carry every edge: {variant.wheels} wheels of {counts:g} "
            f"encoders.counts_per_turn at {max(wheels_rad_s):.1f} rad/s (drive.max_rim_speed_m_s {rim_m_s:g}) need "
            f"{needed:.0f} bytes/s, and link.baud {settings.link.baud} carries {capacity}; use a faster line, "
            "slower wheels, or a board that counts its encoders itself"
        )


def _duty(settings: Settings) -> Iterator[str]:
    most, share = settings.drive.max_duty, settings.safety.wheels.driven_duty_share
    for name, gains in settings.gains().items():
        if round(gains.output_limit) <= share * most:
            yield (
                f"output_limit_duty {gains.output_limit} of {name} never drives it beyond {share * most:g} "
                f"(safety.wheels.driven_duty_share {share:g} of drive.max_duty {most}): no stalled wheel would be found"
            )
        if gains.output_limit > most:
            yield (f"output_limit_duty {gains.output_limit} of {name} is beyond drive.max_duty {most}")


def _names(settings: Settings) -> Iterator[str]:
    names = list(settings.range_mounts())
    if len(names) < len(settings.infrared) + (settings.ultrasonic is not None):
        yield f"range sensors need names of their own, there are {', '.join(names)}"
    joints = joint_names(settings)
    if repeated := sorted({joint for joint in joints if joints.count(joint) > 1} - set(names)):
        yield f"wheels and sensors need joints of their own in the robot's description, repeated: {', '.join(repeated)}"
    channels = [sensor.channel for sensor in settings.infrared]
    if len(set(channels)) < len(channels):
        yield f"infrared sensors need analogue inputs of their own, got channels {channels}"


def _lidars(settings: Settings) -> Iterator[str]:
    """Names and devices must be unique; no lidar may use the board's device, under any name."""
    further = settings.further_scanners
    lidars = [lidar.name for lidar in settings.lidar]
    names = [*settings.range_mounts(), *lidars, *(scanner.name for scanner in further)]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        what = " and ".join(dict.fromkeys(["lidars", *(f"{scanner.kind}s" for scanner in further)]))
        yield f"{what} need names of their own among the sensors, repeated: {', '.join(repeated)}"
    holders = {_device(settings.link.device): "link.device"}
    for lidar in settings.lidar:
        key = f"lidar {lidar.name}"
        if (holder := holders.setdefault(_device(lidar.device), key)) != key:
            yield f"{key} needs a device of its own, {lidar.device!r} is that of {holder}"


def _device(name: str) -> str:
    """The device's real path: names in /dev/serial/by-id are symbolic links."""
    return name if "://" in name else os.path.realpath(name)


def _guard(settings: Settings) -> Iterator[str]:
    guard = settings.safety.guard
    lidars = [lidar.name for lidar in settings.lidar if lidar.guards]
    further = [scanner.name for scanner in settings.further_scanners if scanner.guards]
    sensors = [*settings.range_mounts(), *lidars, *further]
    if guard.enabled and "guard" in settings.safety.model_fields_set and not sensors:
        yield (
            "[safety.guard] has no sensor to guard with: configure [ultrasonic], [[infrared]] or [[lidar]], "
            "or delete the section"
        )
    for sensor in settings.infrared:
        stop_m = max(guard.stop_distance_m, sensor.min_range_m)
        if guard.enabled and stop_m <= sensor.setback_m:
            yield (
                f"infrared {sensor.name} sits {sensor.setback_m:g} m behind the foremost part of the robot, which would "
                f"touch before the guard stops it {stop_m:g} m from the sensor: raise safety.guard.stop_distance_m"
            )


def _turning(settings: Settings) -> Iterator[str]:
    """The lidar guard must not assume more braking than the limits allow, straight or turning."""
    guard, axis, linear = settings.safety.guard, settings.limits.angular.axis, settings.limits.linear.axis
    if not guard.enabled or not any(lidar.guards for lidar in settings.lidar):
        return
    turning = guard.scan.turn_deceleration_rad_s2
    slowest = min(axis.deceleration, axis.reverse_deceleration)
    if turning > slowest:
        yield (
            f"safety.guard.scan.turn_deceleration_rad_s2 {turning:g} counts on more braking than limits.angular "
            f"allows ({slowest:g}): the robot would touch what a lidar sees"
        )
    slowest = min(linear.deceleration, linear.reverse_deceleration)
    if guard.deceleration_m_s2 > slowest:
        yield (
            f"safety.guard.deceleration_m_s2 {guard.deceleration_m_s2:g} counts on more braking than limits.linear "
            f"allows ({slowest:g}): the robot would touch what a lidar sees"
        )


def _nearest(settings: Settings) -> Iterator[str]:
    """The guard must stop the robot before the obstacle is too near to be seen."""
    guard = settings.safety.guard
    for lidar in settings.lidar if guard.enabled else ():
        nearest_m, within_m = lidar.band_m[0], _within_outline_m(settings, lidar.mount_x_m, lidar.mount_y_m)
        kept_m = guard.scan.stop_distance_m + guard.scan.clearance_m
        short_m = nearest_m - within_m - kept_m
        if lidar.guards and short_m > ROUNDING_M:
            enough_m = math.ceil((guard.scan.stop_distance_m + short_m) * 1000 - ROUNDING_M) / 1000
            yield (
                f"the lidar {lidar.name!r} sees nothing nearer than {nearest_m:g} m (its min_range_m) and is mounted "
                f"{within_m:.3g} m within the robot's outline: what the guard stops for, {kept_m:g} m before that, "
                f"would vanish first; set [safety.guard.scan] stop_distance_m = {enough_m:g} "
                f"(it is {guard.scan.stop_distance_m:g}), or mount the lidar further from the edge"
            )


ROUNDING_M = 1e-9


def _within_outline_m(settings: Settings, x_m: float, y_m: float) -> float:
    """How far a point is from the nearest edge of the body, or of the box about the wheels; negative outside."""
    wheels = (2 * max(wheel.radius_m for wheel in settings.chassis.wheels), settings.chassis.track_width_m)
    length_m, width_m = settings.body_size_m or wheels
    if width_m is None:
        return length_m / 2 - math.hypot(x_m, y_m)
    return min(length_m / 2 - abs(x_m), width_m / 2 - abs(y_m))


BRAKING_SLACK_M = 0.01
"""The guard keeps its stop distance as well as this."""


def _braking(settings: Settings) -> Iterator[str]:
    """The guard must not assume more braking than the limits allow, for any sensor that looks where the robot drives.

    It assumes a distance of ``c^2 / 2a`` from a closing speed ``c``. At speed ``v`` a slanting beam shortens by ``p v``,
    and braking takes ``p`` times the braking distance. A jerk limit makes that longer, most of all at low speed. Turning
    is not checked: no obstacle stays in the beam for that much of a turn.
    """
    guard, axis, linear = settings.safety.guard, settings.limits.linear.axis, settings.limits.linear
    if not guard.enabled:
        return
    for beam in from_mounts(settings.range_mounts()):
        if beam.per_linear == 0:
            continue
        forward = beam.per_linear > 0
        key = "deceleration_m_s2" if forward else "reverse_deceleration_m_s2"
        allowed_m_s2 = axis.deceleration if forward else axis.reverse_deceleration
        if guard.deceleration_m_s2 > allowed_m_s2:
            yield (
                f"safety.guard.deceleration_m_s2 {guard.deceleration_m_s2:g} counts on more braking than "
                f"limits.linear.{key} {allowed_m_s2:g} allows: the robot would touch what {beam.sensor} sees"
            )
            continue
        top_m_s = min(axis.max_forward if forward else axis.max_reverse, settings.drive.max_rim_speed_m_s)
        slant, counted_on = abs(beam.per_linear), 2 * guard.deceleration_m_s2
        brakings = [braking_distance(axis, top_m_s * share / 20, forward=forward) for share in range(1, 21)]
        short_m, from_m_s, needed_m = max(
            (slant * (needed_m - slant * from_m_s**2 / counted_on), from_m_s, needed_m)
            for from_m_s, needed_m in brakings
        )
        if short_m > BRAKING_SLACK_M:
            jerk = "" if linear.jerk_m_s3 is None else f" with jerk_m_s3 {linear.jerk_m_s3:g}"
            yield (
                f"safety.guard.deceleration_m_s2 {guard.deceleration_m_s2:g} counts on "
                f"{needed_m - short_m / slant:.3f} m to brake from {from_m_s:.2f} m/s before what {beam.sensor} "
                f"sees, and limits.linear.{key} "
                f"{allowed_m_s2:g}{jerk} takes {needed_m:.3f} m: lower the guard's, or raise the limits"
            )


def _page(settings: Settings) -> Iterator[str]:
    api, page = settings.api, settings.page
    if page.enabled and not is_loopback(page.host) and not (api.token_file or api.token_credential):
        yield (
            f"page.host {page.host!r} is beyond this computer, where the page needs a token: set api.token_file (or "
            "api.token_credential), and better api.tls_certificate and api.tls_key too; or serve it on 127.0.0.1"
        )
    if page.enabled and page.port and page.port == settings.api.port:
        yield f"page.port and api.port are both {page.port}: each needs its own"
