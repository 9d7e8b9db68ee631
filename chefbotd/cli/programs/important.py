"""The ten lines of a configuration that matter most, for ``check-config``."""

import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from chefbotd.settings import Settings

COLUMNS: Final = 80
INDENT: Final = " " * 11


def important_lines(settings: "Settings") -> Iterator[str]:
    """A line each, with the keys that say so: these have lines of their own where a terminal is too narrow for both."""
    chassis, drive, gains = settings.chassis, settings.drive, settings.pid
    wheels = ", ".join(f"{wheel.name} {wheel.radius_m:g} m" for wheel in chassis.wheels)
    rows = [
        ("robot", f"{settings.robot.name}, wire {settings.robot.wire!r}", "[robot] name, wire"),
        ("board", f"{settings.link.device}, {settings.link.baud} baud", "[link] device, baud"),
        ("wheels", wheels, "[[chassis.wheels]] radius_m"),
        ("track", f"{chassis.effective_track_m:.4g} m", "[chassis] track_width_m, track_multiplier"),
        ("encoders", f"{settings.encoders.counts_per_turn:g} counts a turn, below "
         f"{settings.encoders.max_speed_rad_s:g} rad/s", "[encoders] counts_per_turn, max_speed_rad_s"),
        ("motors", f"{drive.max_rim_speed_m_s:g} m/s under load, {_feedforward(settings)}",
         "[drive] max_rim_speed_m_s" + (", motors; [pid] ks_duty, kv_duty_per_m_s" if gains.kv else "; [pid]")),
        ("limits", f"{settings.limits.linear.max_forward_m_s:g} m/s, {settings.limits.angular.max_left_rad_s:g} rad/s",
         "[limits]"),
        ("sensors", _sensors(settings), "[ultrasonic], [[infrared]], [[lidar]], [[depth_camera]], [imu], [battery]"),
        ("guard", _guard(settings), "[safety.guard], [body]"),
        ("served at", f"{settings.api.host}:{settings.api.port}" + (
            f", page at {settings.page.host}:{settings.page.port}" if settings.page.enabled else ", no page"),
         "[api], [page]"),
    ]  # fmt: skip
    for name, value, keys in rows:
        line = f"{name:<10} {value}   ({keys})"
        yield from [line] if len(line) <= COLUMNS else _folded(f"{name:<10} {value}", f"({keys})")


def _folded(value: str, keys: str) -> Iterator[str]:
    for text, indent in ((value, ""), (keys, INDENT)):
        yield from textwrap.wrap(
            text, COLUMNS, initial_indent=indent, subsequent_indent=INDENT,
            break_long_words=False, break_on_hyphens=False,
        )  # fmt: skip


def _feedforward(settings: "Settings") -> str:
    if settings.drive.motors:
        return "by calibrated models of the motors"
    return f"feedforward {settings.pid.ks:g} + {settings.pid.kv:g} per m/s of {settings.drive.max_duty}"


def _sensors(settings: "Settings") -> str:
    named = [
        *([f"ultrasonic {settings.ultrasonic.name}"] if settings.ultrasonic else []),
        *(f"infrared {sensor.name}" for sensor in settings.infrared),
        *(f"lidar {lidar.name}" for lidar in settings.lidar),
        *(f"{scanner.kind} {scanner.name}" for scanner in settings.further_scanners),
        *(["IMU"] if settings.imu else []),
        *(["battery"] if settings.battery else []),
    ]
    return ", ".join(named) or "none"


def _guard(settings: "Settings") -> str:
    """Whether anything stops the robot before an obstacle, and the outline that it keeps clear."""
    sees = settings.range_mounts() or settings.lidar or settings.further_scanners
    if not sees:
        return "nothing sees obstacles: the robot drives into what is in its way"
    if not settings.safety.guard.enabled:
        return "OFF: the robot drives into what it sees"
    if not settings.lidar and not settings.further_scanners:
        return f"on, only in the beam of {', '.join(settings.range_mounts())}"
    body = settings.body
    if body is None:
        return "on, around the box about the wheels"
    size = (
        f"round, {body.length_m:g} m" if body.width_m is None else f"{body.length_m:g} x {body.width_m:g} m"
    )
    return f"on, around the robot's outline: {size}"
