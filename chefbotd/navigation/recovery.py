"""The recovery attempts of a robot that cannot go on, one after another, until it gives up with a reason."""

from enum import StrEnum
from typing import Final

from chefbotd.core.record import Record, replace

STUCK_S: Final = 1.5
"""Something is in the way for so long;"""

WALKER_S: Final = 6.0
"""somebody who walked a moment ago for so long: until then the robot just waits for him to go on."""

DETOUR_S: Final = 15.0
"""For somebody on its path the robot waits as long as the way round would take it, and no longer than this,"""

SOMEBODY_S: Final = 30.0
"""if somebody walked there so lately, and nothing has stood there for so long."""

LOOK_S: Final = 1.0
BACK_OUT_M: Final = 0.35
BACK_OUT_S: Final = 6.0
CLOSED_S: Final = 45.0
"""For so long a place where there was no way through counts as closed when another way is looked for."""

CLOSED_RADIUS_M: Final = 0.15
WAIT_S: Final = 12.0
ASK_S: Final = 12.0
PATIENCE_S: Final = 60.0
"""A way that opens and closes again, as where people go to and fro, is tried for so long at least."""

AGAIN_S: Final = 1.0
"""While it waits it looks for a path so often."""

PROGRESS_M: Final = 0.6


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


class Recovery(Record, frozen=True):
    """What is being tried since when; since when and where (distance to go) the robot could not go on."""

    rung: Rung
    rung_began_s: float
    began_s: float
    left_m: float


def stuck(last: Recovery | None, now_s: float, left_m: float) -> Recovery | None:
    """Begin with the first rung, or, with no progress since the last recovery, go on with the one after its last.

    None: there is none left and its patience is over, so the goal is blocked.
    """
    if last is None or last.left_m - left_m > PROGRESS_M:
        return Recovery(Rung.LOOK, now_s, now_s, left_m)
    following = after(last, now_s)
    if following is None and now_s - last.began_s < PATIENCE_S:
        return replace(last, rung=Rung.WAIT, rung_began_s=now_s)
    return following


def after(recovery: Recovery, now_s: float) -> Recovery | None:
    """The next thing to try; None after the last."""
    place = ORDER.index(recovery.rung) + 1
    return None if place == len(ORDER) else replace(recovery, rung=ORDER[place], rung_began_s=now_s)


def is_over(recovery: Recovery, now_s: float, slower: float = 1.0) -> bool:
    """Whether what is tried has had its time; a robot that is ``slower`` takes so many times as long."""
    times = {
        Rung.LOOK: LOOK_S * slower,
        Rung.BACK_OUT: BACK_OUT_S * slower,
        Rung.OTHER_WAY: 0.0,
        Rung.WAIT: WAIT_S,
        Rung.ASK: ASK_S,
    }
    return now_s - recovery.rung_began_s >= times[recovery.rung]
