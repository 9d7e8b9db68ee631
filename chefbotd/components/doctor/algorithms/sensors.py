"""Range sensors and the IMU: whether they measure, and whether their axes are those of the robot."""

import math
from collections.abc import Mapping, Sequence

from chefbotd.components.doctor.algorithms.finding import Finding, ok, problem, skip_check, warning
from chefbotd.core.record import Record

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

AHEAD_M = 0.5
"""How far ahead of the robot something is placed for its range sensors and lidars."""

AHEAD_BAND_M = (0.2, 0.8)
NOTICED_M = 0.1
TURNED_RAD = 0.3
AGREEMENT = 0.25
LIFTED_SHARE = 0.08
GRAVITY_M_S2 = 9.81
GRAVITY_BAND_M_S2 = (8.5, 11.2)


class Beams(Record, frozen=True):
    """The readings of a range sensor: how often each status came, and the median distance."""

    statuses: Mapping[str, int]
    range_m: float | None = None


class Attitude(Record, frozen=True):
    """The IMU's readings at rest: its orientation (x, y, z, w) or acceleration, and its heading."""

    orientation: Quaternion | None = None
    acceleration_m_s2: Vector | None = None
    heading_rad: float | None = None

    @property
    def nose_up(self) -> float | None:
        """The sine of the angle by which the nose is up (REP-103: a positive pitch is nose down)."""
        if self.orientation is not None:
            x, y, z, w = self.orientation
            return -2.0 * (w * y - z * x)
        if self.acceleration_m_s2 is not None:
            return self.acceleration_m_s2[0] / GRAVITY_M_S2
        return None


def check_beams(name: str, beams: Beams | None, *, kind: str) -> Finding:
    """Whether a range sensor measures at all. In a large room none need see anything."""
    check = f"{kind} {name}"
    if beams is None or not beams.statuses:
        return problem(
            check, f"{name} told nothing", "does the sketch read it, and is its configuration right?"
        )
    total, seen = sum(beams.statuses.values()), beams.statuses.get("ok", 0)
    counts = ", ".join(f"{count} {status.replace('_', ' ')}" for status, count in beams.statuses.items())
    if seen:
        return ok(check, f"{name} measured {beams.range_m or 0:.2f} m (of {total}: {counts})")
    if beams.statuses.get("too_far") == total:
        return skip_check(
            check,
            f"nothing is within the range of {name}, or it is unplugged (of {total}: {counts})",
            "hold a book 30 cm in front of it, and run the doctor again",
        )
    return warning(
        check,
        f"{name} measured no distance (of {total}: {counts})",
        "hold a book 30 cm before it and look again; if it still measures none: its plug, its 5 V, its two wires",
    )


def check_beam_ahead(name: str, before_m: float | None, after_m: float | None) -> Finding:
    """Whether a sensor that looks ahead sees what was placed there."""
    check, near, far = f"ahead {name}", *AHEAD_BAND_M
    text = f"{name} says {_metres(after_m)} to what stands {AHEAD_M:g} m ahead (before: {_metres(before_m)})"
    if after_m is not None and near <= after_m <= far:
        if before_m is None or abs(before_m - after_m) > NOTICED_M:
            return ok(check, text)
        return warning(check, f"{text}: that was there before", "clear the way ahead for 2 m, and try again")
    return problem(
        check,
        text,
        "does it point ahead, and is it connected to the configured input?",
    )


def _metres(range_m: float | None) -> str:
    return "nothing" if range_m is None else f"{range_m:.2f} m"


def check_imu(
    attitudes: Sequence[Attitude], *, configured: bool, sends_imu: bool, left_out: str = ""
) -> Finding:
    """Whether the IMU sends, whether gravity shows that its z axis points up, and why the daemon has ``left_out`` it."""
    if not configured:
        return skip_check("imu", "no [imu] is configured")
    if not attitudes:
        if sends_imu:
            return problem("imu", "its lines arrive, but none is valid", "see the finding on damaged lines")
        return warning(
            "imu",
            "no 'i' lines come",
            "the sketch has none, or did not find it: look at its plug, SDA and SCL; where there is none, remove [imu]",
        )
    text = f"{len(attitudes)} readings"
    gravity = attitudes[-1].acceleration_m_s2
    if gravity is not None and not GRAVITY_BAND_M_S2[0] < gravity[2] < GRAVITY_BAND_M_S2[1]:
        return problem(
            "imu",
            f"{text}; at rest it measures {gravity[2]:+.1f} m/s² along the robot's z axis, expected +9.8",
            "its z axis must point up: mount it flat",
        )
    if left_out:
        return problem(
            "imu", f"{text}; {left_out}", "mend that, then start the daemon again: it judges the IMU anew"
        )
    return ok("imu", text)


def check_imu_turn(imu_rad: float | None, encoders_rad: float) -> Finding:
    """The robot was turned to the left: the IMU's heading grows, as much as the encoders say."""
    if imu_rad is None:
        return skip_check("imu_turn", "the IMU reports no heading")
    imu_deg, encoders_deg = math.degrees(imu_rad), math.degrees(encoders_rad)
    text = f"turned to the left, the IMU says {imu_deg:+.0f}°, the encoders {encoders_deg:+.0f}°"
    if imu_rad < -TURNED_RAD:
        return problem(
            "imu_turn", f"{text}: the IMU is upside down or its axes are exchanged", "mount its z axis up"
        )
    if imu_rad < TURNED_RAD:
        return problem(
            "imu_turn",
            f"{text}: the IMU hardly measured the turn",
            "its z axis does not point up, or it has frozen",
        )
    if encoders_rad > TURNED_RAD and abs(imu_rad / encoders_rad - 1) > AGREEMENT:
        return warning(
            "imu_turn",
            text,
            "the two differ: measure [chassis] track_width_m (or track_multiplier) with 'chefbotctl square'",
        )
    return ok("imu_turn", text)


def check_imu_lift(flat: Attitude | None, lifted: Attitude | None) -> Finding:
    """The robot's front was lifted: the IMU's nose goes up."""
    if flat is None or lifted is None or flat.nose_up is None or lifted.nose_up is None:
        return skip_check("imu_tilt", "the IMU reports no attitude")
    rise = lifted.nose_up - flat.nose_up
    text = f"with its front lifted, the IMU says nose {'up' if rise > 0 else 'down'} by {_degrees(rise)}°"
    if rise > LIFTED_SHARE:
        return ok("imu_tilt", text)
    if rise < -LIFTED_SHARE:
        return problem(
            "imu_tilt",
            f"{text}: its x axis points backwards",
            "turn it round, or set [imu] mount_heading_rad = 3.14",
        )
    return problem(
        "imu_tilt",
        f"{text}: it did not measure the tilt",
        "its x axis points to a side, or it was not lifted enough",
    )


def _degrees(rise: float) -> str:
    return f"{abs(math.degrees(math.asin(max(-1.0, min(1.0, rise))))):.0f}"


def check_battery(
    voltage_v: float | None,
    status: str,
    *,
    sends_battery: bool,
    absent_below_v: float,
    low_v: float,
    critical_v: float,
) -> Finding:
    """Whether the battery has enough charge to drive."""
    if voltage_v is None:
        if sends_battery:
            return problem("battery", "no voltage could be read", "see the finding on damaged lines")
        return skip_check(
            "battery", "the board sends no 'b' lines", "sketch C never does: measure it by hand"
        )
    text = f"the battery has {voltage_v:.2f} V"
    if voltage_v < absent_below_v:
        return warning(
            "battery",
            f"{text}: nothing seems to be wired to the pin",
            "wire the divider, or take it as it is",
        )
    if status == "critical" or voltage_v <= critical_v:
        return problem("battery", f"{text}: it is flat (critical at {critical_v:g} V)", "charge it now")
    if status == "low" or voltage_v <= low_v:
        return warning("battery", f"{text}: it is low (low at {low_v:g} V)", "charge it soon")
    return ok("battery", text)
