"""The recovery attempts of a robot that cannot go on, one after another, until it gives up with a reason."""

from dataclasses import dataclass, replace
from enum import StrEnum

from pydantic import Field

from chefbotd.core.parameters import Parameters


class RecoveryParameters(Parameters):
    """For how long each is tried; when blocked again within ``progress_m``, the robot goes on with the next."""

    stuck_s: float = Field(default=1.5, gt=0, le=60)
    """Something is in the way for so long;"""
    walker_s: float = Field(default=6.0, gt=0, le=60)
    """somebody who walked a moment ago for so long: until then the robot just waits for him to go on."""
    detour_s: float = Field(default=15.0, ge=0, le=600)
    """For somebody on its path the robot waits as long as the way round would take it, and no longer than this,"""
    somebody_s: float = Field(default=30.0, ge=0, le=600)
    """if somebody walked there so lately, and nothing has stood there for so long."""
    look_s: float = Field(default=1.0, gt=0, le=60)
    back_out_m: float = Field(default=0.35, ge=0, le=5)
    back_out_s: float = Field(default=6.0, gt=0, le=60)
    closed_s: float = Field(default=45.0, gt=0, le=3600)
    """For so long a place where there was no way through counts as closed when another way is looked for."""
    closed_radius_m: float = Field(default=0.15, gt=0, le=2)
    wait_s: float = Field(default=12.0, ge=0, le=600)
    ask_s: float = Field(default=12.0, ge=0, le=600)
    patience_s: float = Field(default=60.0, ge=0, le=600)
    """A way that opens and closes again, as where people go to and fro, is tried for so long at least."""
    again_s: float = Field(default=1.0, gt=0, le=60)
    """While it waits it looks for a path so often."""
    progress_m: float = Field(default=0.6, gt=0, le=10)


class Rung(StrEnum):
    """What is tried, in this order."""

    LOOK = "look"
    BACK_OUT = "back_out"
    OTHER_WAY = "other_way"
    WAIT = "wait"
    ASK = "ask"


ORDER = tuple(Rung)
SAID = {
    Rung.LOOK: "stops and looks again",
    Rung.BACK_OUT: "backs out the way it came",
    Rung.OTHER_WAY: "looks for another path",
    Rung.WAIT: "waits for the way to become free",
    Rung.ASK: "asks people to clear the way",
}


@dataclass(frozen=True, slots=True)
class Recovery:
    """What is being tried since when; since when and where (distance to go) the robot could not go on."""

    rung: Rung
    rung_began_s: float
    began_s: float
    left_m: float


def stuck(params: RecoveryParameters, last: Recovery | None, now_s: float, left_m: float) -> Recovery | None:
    """Begin with the first rung, or, with no progress since the last recovery, go on with the one after its last.

    None: there is none left and its patience is over, so the goal is blocked.
    """
    if last is None or last.left_m - left_m > params.progress_m:
        return Recovery(Rung.LOOK, now_s, now_s, left_m)
    following = after(last, now_s)
    if following is None and now_s - last.began_s < params.patience_s:
        return replace(last, rung=Rung.WAIT, rung_began_s=now_s)
    return following


def after(recovery: Recovery, now_s: float) -> Recovery | None:
    """The next thing to try; None after the last."""
    place = ORDER.index(recovery.rung) + 1
    return None if place == len(ORDER) else replace(recovery, rung=ORDER[place], rung_began_s=now_s)


def is_over(params: RecoveryParameters, recovery: Recovery, now_s: float) -> bool:
    """Whether what is tried has had its time."""
    times = {
        Rung.LOOK: params.look_s,
        Rung.BACK_OUT: params.back_out_s,
        Rung.OTHER_WAY: 0.0,
        Rung.WAIT: params.wait_s,
        Rung.ASK: params.ask_s,
    }
    return now_s - recovery.rung_began_s >= times[recovery.rung]
