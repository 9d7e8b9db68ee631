"""Finding the way on the map in use: ``set_pose``, ``localize``, and the topic ``localization``."""

import math
from typing import Annotated

from msgspec import Meta
from pydantic import Field

from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.core.record import Record
from chefbotd.rpc.models import MotionParams, Params
from chefbotd.rpc.topics import Topic

MOST_M = 1e4


class SetPoseParams(Params):
    """Where the robot is in the map, to about 0.5 m and 20 degrees."""

    x_m: float = Field(ge=-MOST_M, le=MOST_M)
    y_m: float = Field(ge=-MOST_M, le=MOST_M)
    heading_rad: float = Field(0.0, ge=-math.tau, le=math.tau, description="CCW positive")


class LocalizeParams(MotionParams):
    """Whether the robot may move."""

    turn: bool = Field(
        False, description="turn once on the spot, where looking for 3 s is not enough; answers at its end"
    )


class PlaceCandidate(Record, frozen=True):
    """A place where the robot may be."""

    x_m: float
    y_m: float
    heading_rad: float
    fit: float


class LocalizationData(Record, frozen=True):
    """Whether the robot knows where it is; ``reason`` says what is wrong, if anything is."""

    state: Annotated[str, Meta(description="unknown, searching, localized, uncertain or lost")] = "unknown"
    map: str | None = None
    fit: Annotated[float, Meta(description="how well the scan fits, from 0 to 1")] = 0.0
    alternatives: Annotated[
        tuple[PlaceCandidate, ...], Meta(description="while it searches: all places where the robot may be")
    ] = ()
    searched: Annotated[float, Meta(description="share of the search that is done")] = 0.0
    jumps: Annotated[int, Meta(description="how often the published pose jumped")] = 0
    reason: str = ""


def localization_data(event: LocalizationChanged | None) -> LocalizationData:
    """What the topic ``localization`` tells of an event."""
    if event is None:
        return LocalizationData()
    return LocalizationData(
        state=event.state,
        map=event.map,
        fit=event.fit,
        alternatives=tuple(
            PlaceCandidate(
                x_m=one.map_from_base.x_m,
                y_m=one.map_from_base.y_m,
                heading_rad=one.map_from_base.heading_rad,
                fit=one.fit,
            )
            for one in event.alternatives
        ),
        searched=event.searched,
        jumps=event.jumps,
        reason=event.reason,
    )


TOPICS = (
    Topic(
        "localization",
        (LocalizationChanged,),
        LocalizationData,
        localization_data,
        always_known=True,
        for_guests=True,
    ),
)
