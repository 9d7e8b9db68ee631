"""The typed client's methods of navigation that do more than ask: they wait for the goal."""

from __future__ import annotations

import asyncio
import contextlib
from typing import TYPE_CHECKING, Any, Literal

from chefbotd.client.caller import MethodCaller, drop_defaults
from chefbotd.client.errors import ChefbotError, not_reached

if TYPE_CHECKING:
    from chefbotd.client import models
    from chefbotd.client.wire import ProgressListener


class NavigationMethods(MethodCaller):
    """The methods of navigation."""

    async def navigate_to(
        self,
        x_m: float | None = None,
        y_m: float | None = None,
        heading_rad: float | None = None,
        *,
        place: str | None = None,
        tolerance_m: float | None = None,
        max_speed_m_s: float | None = None,
        queue: bool | None = None,
        goal_id: str | None = None,
        on_client_left: Literal["cancel", "keep"] | None = None,
        if_stop_number: int | None = None,
        on_progress: ProgressListener | None = None,
    ) -> str:
        """Drive to a place, or to a pose in the map in use, and wait for the end; the sentence about it.

        With ``queue`` it comes after the goals that there are; otherwise they are cancelled. Where this is cancelled,
        so is the goal, with those that were queued behind it; the robot stands, unless a goal comes before.
        ``on_progress`` is told the metres that are done, all of them, and what the robot does.
        A ``goal_id`` that the daemon knows already begins no new goal: this waits for the end of that goal. With
        ``on_client_left`` "keep" the goal outlives this client, which can wait for it again by its ``goal_id``. With
        ``if_stop_number`` it is refused as ``stopped_since`` where the robot was stopped after this was its number.

        Raises:
            GoalNotReached: the goal ended otherwise; its subclass and ``reason`` say how.
            CallError: it was refused, as where there is no such place.
        """
        goal = drop_defaults(
            x_m=x_m,
            y_m=y_m,
            heading_rad=heading_rad,
            place=place,
            tolerance_m=tolerance_m,
            max_speed_m_s=max_speed_m_s,
            queue=queue,
            goal_id=goal_id,
            on_client_left=on_client_left,
            if_stop_number=if_stop_number,
        )
        return await self._until_reached("navigate_to", goal, on_progress)

    async def follow_waypoints(
        self,
        places: list[str],
        *,
        queue: bool | None = None,
        if_stop_number: int | None = None,
        on_progress: ProgressListener | None = None,
    ) -> str:
        """Drive to places one after the other, and wait for the end; queued and raises as ``navigate_to``."""
        waypoints = drop_defaults(
            waypoints=[{"place": place} for place in places], queue=queue, if_stop_number=if_stop_number
        )
        return await self._until_reached("follow_waypoints", waypoints, on_progress)

    async def go_home(
        self, *, if_stop_number: int | None = None, on_progress: ProgressListener | None = None
    ) -> str:
        """Drive to the place that is the robot's home, and wait for the end; raises as ``navigate_to`` does."""
        return await self._until_reached("go_home", drop_defaults(if_stop_number=if_stop_number), on_progress)

    async def dock(
        self, *, if_stop_number: int | None = None, on_progress: ProgressListener | None = None
    ) -> str:
        """Drive to the place where the robot is charged, and wait for the end; raises as ``navigate_to`` does."""
        return await self._until_reached("dock", drop_defaults(if_stop_number=if_stop_number), on_progress)

    async def _until_reached(
        self, method: str, params: dict[str, Any], on_progress: ProgressListener | None
    ) -> str:
        """Cancelled, it has the request cancelled, and its goals with it; others keep theirs."""
        try:
            result: models.GoalResult = await self._ask(
                "GoalResult", method, on_progress=on_progress, wait=True, **params
            )
        except asyncio.CancelledError:
            with contextlib.suppress(ChefbotError):
                await self.call("ping")  # when this is answered, the daemon has read that
            raise
        if result.end != "reached":
            raise not_reached(result.goal, result.end or "unknown", result.reason, result.cause or "")
        return result.reason
