"""Encoders that fall silent: nobody drives a robot that cannot be seen to move.

Silence is a stop and not yet a fault. The classic sketch says nothing for up to a second while it waits for an
ultrasonic echo, as a matter of course, and a latch that trips in health is a latch that people learn to ignore: so the
robot brakes, and goes on from rest with the next reading if somebody still commands it. A silence longer than any that
the sketch has a reason for, which began while the robot was driven, is a fault.
"""

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.safety.faults import Fault, FaultKind


class EncoderTimeoutParameters(Parameters):
    """``max_age_s``: how old the last encoder reading may be for the robot to move. ``latch_after_s``: see above."""

    max_age_s: float = Field(default=0.25, gt=0, le=2)
    latch_after_s: float = Field(default=2.0, ge=2, le=60)


class EncoderTimeoutState(Record, frozen=True):
    """When the encoders were last heard, and whether the robot was being driven when they fell silent."""

    heard_s: float = float("-inf")
    interrupted: bool = False


def is_stale(params: EncoderTimeoutParameters, state: EncoderTimeoutState, now_s: float) -> bool:
    """Whether the robot must stand still for want of a reading."""
    return now_s - state.heard_s > params.max_age_s


def update(
    params: EncoderTimeoutParameters, state: EncoderTimeoutState, now_s: float, *, driven: bool
) -> tuple[EncoderTimeoutState, Fault | None]:
    """The encoders are stale: ``driven`` tells whether there still is a duty to take away."""
    interrupted = state.interrupted or driven
    silent_s = now_s - state.heard_s
    if not interrupted or silent_s <= params.latch_after_s:
        return EncoderTimeoutState(state.heard_s, interrupted), None
    reason = (
        f"no encoder reading for {silent_s:.1f} s while the robot was driven: "
        "check that the board runs and that its sketch still sends 'e' lines"
    )
    return EncoderTimeoutState(state.heard_s), Fault(FaultKind.ENCODERS_SILENT, reason)
