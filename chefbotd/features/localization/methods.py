"""Finding the way on the map in use: ``set_pose``, ``localize``, and the topic ``localization``."""

import math
from typing import Protocol

from pydantic import Field

from chefbotd.core.events.mapping import LocalizationChanged
from chefbotd.rpc.jobs import Progress
from chefbotd.rpc.method import Caller, method
from chefbotd.rpc.models import Params, Result, TopicData
from chefbotd.rpc.roles import Role
from chefbotd.rpc.topics import Topic

MOST_M = 1e4


class SetPoseParams(Params):
    """Where the robot is in the map, to about 0.5 m and 20 degrees."""

    x_m: float = Field(ge=-MOST_M, le=MOST_M)
    y_m: float = Field(ge=-MOST_M, le=MOST_M)
    heading_rad: float = Field(0.0, ge=-math.tau, le=math.tau, description="CCW positive")


class LocalizeParams(Params):
    """Whether the robot may move."""

    turn: bool = Field(
        False, description="turn once on the spot, where looking for 3 s is not enough; answers at its end"
    )


class LocalizationResult(Result):
    """How localization stands now; the topic tells how it goes on. ``reason``: what came of a turn."""

    state: str = Field(description="unknown, searching, localized, uncertain or lost")
    map: str | None
    reason: str = ""


class PlaceCandidate(Result):
    """A place where the robot may be."""

    x_m: float
    y_m: float
    heading_rad: float
    fit: float


class LocalizationData(TopicData):
    """Whether the robot knows where it is; ``reason`` says what is wrong, if anything is."""

    state: str = Field(default="unknown", description="unknown, searching, localized, uncertain or lost")
    map: str | None = None
    fit: float = Field(default=0.0, description="how well the scan fits, from 0 to 1")
    alternatives: tuple[PlaceCandidate, ...] = Field(
        default=(), description="while it searches: all places where the robot may be"
    )
    searched: float = Field(default=0.0, description="share of the search that is done")
    jumps: int = Field(default=0, description="how often the published pose jumped")
    reason: str = ""


class Localizer(Protocol):
    """What finds the way. Each raises ``chefbotd.core.commands.Refused`` where it is not done."""

    async def set_pose(self, x_m: float, y_m: float, heading_rad: float) -> LocalizationResult:
        """The robot is about here."""
        ...

    async def localize(self, progress: Progress, *, turn: bool) -> LocalizationResult:
        """Search everywhere; turn once where that is not enough."""
        ...


class LocalizationMethods:
    """The methods of this feature."""

    def __init__(self, localizer: Localizer) -> None:
        self._localizer = localizer

    @method(role=Role.DRIVE, moves=False)
    async def set_pose(self, caller: Caller, params: SetPoseParams, progress: Progress) -> LocalizationResult:
        """Set the robot's approximate pose in the map in use; the next scans confirm it, or it searches."""
        return await self._localizer.set_pose(params.x_m, params.y_m, params.heading_rad)

    @method(role=Role.DRIVE, moves=True)
    async def localize(
        self, caller: Caller, params: LocalizeParams, progress: Progress
    ) -> LocalizationResult:
        """Search the whole map for the robot's pose; the robot does not move, unless ``turn`` allows one turn."""
        return await self._localizer.localize(progress, turn=params.turn)


def _localization(event: LocalizationChanged | None) -> LocalizationData:
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


TOPICS = (Topic("localization", (LocalizationChanged,), LocalizationData, _localization, always_known=True),)
