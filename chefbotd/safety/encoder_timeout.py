"""Detects silent encoders. The robot is not driven while its motion is unknown.

Silence stops the robot and is not a fault yet. The classic sketch regularly says nothing for up to a second while it
waits for an ultrasonic echo. A latch that trips on a healthy robot teaches people to ignore it. So the robot brakes,
and starts from rest with the next reading if it is still commanded. A silence that is longer than the sketch can
explain, and that began while the robot was driven, is a fault.
"""

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.safety.faults import Fault, FaultKind


class EncoderTimeoutParameters(Parameters):
    """How long the encoders may be silent.

    The robot moves only if the last encoder reading is younger than ``max_age_s``. A silence of ``latch_after_s`` that
    began while the robot was driven is a fault.
    """

    max_age_s: float = Field(default=0.25, gt=0, le=2)
    latch_after_s: float = Field(default=2.0, ge=2, le=60)


class EncoderTimeoutState(Record, frozen=True):
    """When the encoders were last heard, and whether the robot was being driven when they fell silent."""

    heard_s: float = float("-inf")
    interrupted: bool = False


def is_stale(params: EncoderTimeoutParameters, state: EncoderTimeoutState, now_s: float) -> bool:
    """Whether the robot must stand still because there is no recent reading."""
    return now_s - state.heard_s > params.max_age_s


def update(
    params: EncoderTimeoutParameters, state: EncoderTimeoutState, now_s: float, *, driven: bool
) -> tuple[EncoderTimeoutState, Fault | None]:
    """The encoders are stale: ``driven`` says whether a duty other than zero is in force."""
    interrupted = state.interrupted or driven
    silent_s = now_s - state.heard_s
    if not interrupted or silent_s <= params.latch_after_s:
        return EncoderTimeoutState(state.heard_s, interrupted), None
    reason = (
        f"no encoder reading for {silent_s:.1f} s while the robot was driven: "
        "check that the board runs and that its sketch still sends 'e' lines"
    )
    return EncoderTimeoutState(state.heard_s), Fault(FaultKind.ENCODERS_SILENT, reason)
