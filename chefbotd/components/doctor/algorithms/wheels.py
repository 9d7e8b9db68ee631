"""Checks of encoders, motors and the duty's scale, by the motion of the wheels during a push or a motor test."""

import math
from collections.abc import Iterator, Mapping, Sequence
from statistics import median

from chefbotd.components.doctor.algorithms.finding import Finding, ok, problem, skip_check, warning
from chefbotd.core.record import Record
from chefbotd.motion.drive_state import LOADED_SHARE
from chefbotd.safety.faults import FaultKind

MOVED_RAD = 0.3
"""A wheel that turned less than this in a push by hand did not turn."""

TURNED_RAD = 0.05
TURNING_RAD_S = 0.25
OUTRUN = 3.0
FRICTION_SHARE = 0.1
"""The share of the full duty that the gearbox's friction takes (that of the published robot)."""

SCALE_RATIO = 1.7
KNOWN_SCALES = (255, 1023)
COUNTS_RATIO = 1.3

Speeds = Mapping[str, float]


class WheelSetting(Record, frozen=True):
    """A wheel as it is configured."""

    name: str
    is_left: bool
    radius_m: float
    motor_sign: int
    encoder_sign: int


class WheelSample(Record, frozen=True):
    """The angles of all wheels at one time, by name."""

    stamp_s: float
    position_rad: Speeds
    velocity_rad_s: Speeds
    duty: Mapping[str, int]


class WheelRun(Record, frozen=True):
    """The motion of all wheels while one wheel was asked to turn forward.

    ``fault`` and ``reason`` are what ended it (empty: nothing), ``held_by`` what slowed it, ``refused`` why
    the daemon took no command. ``seen`` is what somebody
    saw: ``forward``, ``backward``, ``other``, ``nothing``, or empty where nobody looked.
    """

    wheel: str
    samples: tuple[WheelSample, ...]
    fault: str = ""
    reason: str = ""
    held_by: str = ""
    refused: str = ""
    seen: str = ""

    def turned_rad(self, name: str) -> float:
        """How far a wheel went."""
        if not self.samples:
            return 0.0
        return self.samples[-1].position_rad[name] - self.samples[0].position_rad[name]


def check_push(wheels: Sequence[WheelSetting], turned_rad: Speeds) -> list[Finding]:
    """The encoders' signs: the robot went forward, so every wheel must have."""
    if all(abs(turned_rad.get(wheel.name, 0.0)) <= TURNED_RAD for wheel in wheels):
        return [
            problem(
                "encoders",
                "no encoder counted while the robot was pushed",
                "was it pushed on its wheels, by 30 cm? If so, the encoders lack 5 V, or are unplugged",
            )
        ]
    return [_check_pushed(wheel, turned_rad.get(wheel.name, 0.0)) for wheel in wheels]


def _check_pushed(wheel: WheelSetting, turned_rad: float) -> Finding:
    check, text = (
        f"encoder {wheel.name}",
        f"{wheel.name} turned by {turned_rad:+.2f} rad as the robot went forward",
    )
    if turned_rad > MOVED_RAD:
        return ok(check, text)
    if turned_rad < -MOVED_RAD:
        advice = f"set encoder_sign = {-wheel.encoder_sign} for {wheel.name}, or exchange its encoder's A and B wires"
        return problem(check, f"{text}: it counts backwards", advice)
    return problem(
        check,
        f"{text}: its encoder counts nothing",
        "check the encoder's plug, its 5 V and its two wires A and B",
    )


def check_distance(encoders_m: float, real_m: float, counts_per_turn: float) -> Finding:
    """Whether the counts make the right distance."""
    if real_m <= 0:
        return skip_check("distance", "the distance was not measured")
    ratio = encoders_m / real_m
    text = f"the encoders say {encoders_m:.3f} m, you measured {real_m:.3f} m"
    if not ratio > 0:
        return skip_check("distance", f"{text}: see the encoders first")
    if 1 / COUNTS_RATIO < ratio < COUNTS_RATIO:
        return ok("distance", text)
    return problem(
        "distance",
        text,
        f"set [encoders] counts_per_turn = {counts_per_turn * ratio:.0f} (it is {counts_per_turn:.0f}), if the wheels' "
        "radius is right; then measure over 2 m",
    )


def check_turn(turned_rad: float, wheels: Sequence[WheelSetting], by_wheel_rad: Speeds) -> Finding:
    """The robot was turned to the left: the encoders must say so, or the sides are exchanged."""
    text = f"the encoders say {math.degrees(turned_rad):+.0f}° as the robot was turned to the left"
    if turned_rad > MOVED_RAD:
        return ok("turn", text)
    if turned_rad < -MOVED_RAD:
        sides = ", ".join(f"{wheel.name} {by_wheel_rad.get(wheel.name, 0.0):+.1f} rad" for wheel in wheels)
        return problem(
            "turn", f"{text}: the left and right encoders are exchanged ({sides})", "exchange their plugs"
        )
    return problem(
        "turn", f"{text}: the encoders measured nothing", "was it turned that far? If so, check the encoders"
    )


def check_motor(wheels: Sequence[WheelSetting], run: WheelRun) -> Finding:
    """A motor's direction and its place, by the encoders and by what somebody saw."""
    wheel = next(other for other in wheels if other.name == run.wheel)
    check = f"motor {wheel.name}"
    if not any(sample.duty[wheel.name] for sample in run.samples):
        return skip_check(
            check, f"{wheel.name} was not driven{_because(run)}", "fix that, and run the doctor again"
        )
    own = run.turned_rad(wheel.name)
    others = [
        other.name for other in wheels if other is not wheel and _outran(run.turned_rad(other.name), own)
    ]
    text = f"{wheel.name} was driven forward: its encoder reports {own:+.2f} rad"
    if run.seen:
        text += f", you saw {_seen(run.seen)}"
    if others:
        return _report_exchange(check, text, wheel, others, run)
    if abs(own) <= TURNED_RAD:
        return _still(check, text, run)
    if run.seen == "other":
        return problem(
            check,
            f"{text}: motor and encoder of two wheels are exchanged, both",
            "exchange the wheels' plugs, or their order in [[chassis.wheels]]",
        )
    return _direction(check, text, wheel, own > 0, run)


def _outran(other_rad: float, own_rad: float) -> bool:
    """Whether another wheel turned instead; the controller holds that against the wheel's own motor, which twitches."""
    return abs(other_rad) > max(TURNED_RAD, OUTRUN * abs(own_rad))


def _direction(check: str, text: str, wheel: WheelSetting, counts_forward: bool, run: WheelRun) -> Finding:
    motor, encoder = f"motor_sign = {-wheel.motor_sign}", f"encoder_sign = {-wheel.encoder_sign}"
    if run.seen == "backward" and counts_forward:
        return problem(
            check,
            f"{text}: both signs are wrong",
            f"set {motor} and {encoder} for {wheel.name}",
        )
    if counts_forward:
        return ok(check, text)
    if run.seen == "forward":
        return problem(check, f"{text}: its encoder counts backwards", f"set {encoder} for {wheel.name}")
    if run.seen == "backward":
        return problem(
            check, f"{text}: its motor is reversed", f"set {motor} for {wheel.name}, or exchange its wires"
        )
    return problem(
        check,
        f"{text}: its motor or its encoder is reversed",
        f"if it turned backwards: {motor}; if forwards: {encoder}",
    )


def _report_exchange(check: str, text: str, wheel: WheelSetting, others: list[str], run: WheelRun) -> Finding:
    if run.seen in ("forward", "backward"):
        return problem(
            check,
            f"{text}, while {' and '.join(others)} counted: the encoders are exchanged",
            f"exchange the encoders' plugs of {wheel.name} and {others[0]}",
        )
    what = "the motors are" if run.seen == "other" else "the motors (or the encoders) are"
    return problem(
        check,
        f"{text}, while {' and '.join(others)} counted: {what} exchanged",
        f"exchange the motors' plugs of {wheel.name} and {others[0]}, or their order in [[chassis.wheels]]",
    )


def _still(check: str, text: str, run: WheelRun) -> Finding:
    most = max(abs(sample.duty[run.wheel]) for sample in run.samples)
    if run.seen in ("forward", "backward"):
        return problem(
            check,
            f"{text}: its encoder counts nothing",
            "check the encoder's plug, its 5 V and wires A and B",
        )
    if run.fault == FaultKind.COMMANDS_LOST:
        return problem(
            check,
            f"{text}: {run.reason}",
            "check the line to the board first: the wheel is not to blame while no command arrives",
        )
    return problem(
        check,
        f"{text} at a duty of {most}: it does not turn{_because(run)}",
        "check the bridge's power (battery, emergency switch, enable pin), the motor's wires, "
        "and whether the wheel is blocked",
    )


def _because(run: WheelRun) -> str:
    reason = run.reason or run.refused or run.held_by
    return f" ({reason})" if reason else ""


def _seen(seen: str) -> str:
    return {"other": "another wheel turn", "nothing": "nothing turn"}.get(seen, f"it turn {seen}")


def full_scale(run: WheelRun, wheel: WheelSetting, max_rim_speed_m_s: float) -> float | None:
    """The duty that would be full on, by the speed that each duty gave; None where the wheel hardly turned.

    A free motor's speed grows in a straight line from its friction's duty to the full one.
    """
    free_rad_s = max_rim_speed_m_s / LOADED_SHARE / wheel.radius_m
    scales = [
        abs(duty) / (FRICTION_SHARE + (1 - FRICTION_SHARE) * min(abs(speed) / free_rad_s, 1.0))
        for duty, speed in _steady(run)
    ]
    return median(scales) if scales else None


def _steady(run: WheelRun) -> Iterator[tuple[int, float]]:
    """The last third of what turned: the wheel has come up to its speed by then."""
    pairs = [
        (sample.duty[run.wheel], _fastest(sample))
        for sample in run.samples
        if abs(_fastest(sample)) > TURNING_RAD_S and sample.duty[run.wheel]
    ]
    yield from pairs[-max(len(pairs) // 3, 1) :] if pairs else ()


def _fastest(sample: WheelSample) -> float:
    """The wheel that turned most. It is not the one that was asked if plugs are exchanged."""
    return max(sample.velocity_rad_s.values(), key=abs)


HAND_TURNS = 10
"""So often a wheel is turned by hand, to see whether the counts per turn are right."""

TURNS_SHARE = 0.05
"""Nobody turns a wheel more exactly by eye than to half a turn of ten."""


def check_hand_turns(wheel: str, turned_rad: float, counts_per_turn: float) -> Finding:
    """Whether ten turns by hand are ten by the encoder."""
    turns = abs(turned_rad) / math.tau
    text = f"{wheel} was turned {HAND_TURNS} times by hand: its encoder says {turns:.1f} turns"
    if turns < 0.1:
        return skip_check("counts_per_turn", f"{text}, so it was not turned, or its encoder is unplugged")
    if abs(turns / HAND_TURNS - 1) <= TURNS_SHARE:
        return ok("counts_per_turn", text)
    return problem(
        "counts_per_turn",
        text,
        f"set [encoders] counts_per_turn = {counts_per_turn * turns / HAND_TURNS:.0f} (it is {counts_per_turn:.0f}; "
        "'chefbotctl calibrate encoders' measures it exactly); then run the doctor again before any gain is changed",
    )


def check_scale(
    wheels: Sequence[WheelSetting],
    runs: Sequence[WheelRun],
    *,
    max_duty: int,
    max_rim_speed_m_s: float,
    counts_are_right: bool = True,
) -> Finding:
    """Whether a duty of ``max_duty`` is full on, by what the wheels reached.

    Unless the ``counts_are_right``, by a wheel that was turned by hand, a speed that does not fit blames neither.
    """
    by_name = {wheel.name: wheel for wheel in wheels}
    estimates = [full_scale(run, by_name[run.wheel], max_rim_speed_m_s) for run in runs]
    scales = [scale for scale in estimates if scale is not None]
    if not scales:
        return skip_check("duty_scale", "no wheel turned enough to tell", "see the findings on the motors")
    scale = median(scales)
    nearest = min(KNOWN_SCALES, key=lambda candidate: abs(math.log(candidate / scale)))
    text = f"the wheels' speeds suggest a full scale of about {scale:.0f}, but [drive] max_duty is {max_duty}"
    if 1 / SCALE_RATIO < max_duty / scale < SCALE_RATIO:
        return ok("duty_scale", text)
    if not counts_are_right:
        return problem(
            "duty_scale",
            f"{text}; wrong counts per turn look the same",
            "turn a wheel ten times by hand first ('chefbotctl calibrate encoders'), set what that finds, and run the "
            "doctor again",
        )
    gains = (
        f"set max_duty = {nearest}, and multiply every gain in [pid] whose name has 'duty' by {nearest / max_duty:.3g}; "
        "then 'chefbotctl pid tune'"
    )
    if max_duty > scale:
        return problem(
            "duty_scale",
            f"{text}: most likely it is {nearest}, and the robot drives much faster than asked",
            gains,
        )
    return problem(
        "duty_scale",
        f"{text}: most likely it is {nearest}, and the robot hardly moves or never gets up to speed",
        gains,
    )


def check_faults(runs: Sequence[WheelRun]) -> list[Finding]:
    """Why the daemon stopped the wheel."""
    stopped = [f"{run.wheel}: {run.reason}" for run in runs if run.fault]
    if not stopped:
        return []
    return [
        warning(
            "stopped_by_daemon",
            f"the daemon stopped the motors on its own: {'; '.join(stopped)}",
            "it was right to: mend what it names, unless the findings on motors and duty scale explain it",
        )
    ]
