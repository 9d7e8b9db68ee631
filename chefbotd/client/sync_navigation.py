"""Navigation without asyncio: same names, plain calls."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Coroutine
from typing import TYPE_CHECKING, Any, TypeVar

from chefbotd.client.client import Client
from chefbotd.client.wire import ProgressListener

if TYPE_CHECKING:
    from chefbotd.client import models

T = TypeVar("T")


class SyncNavigation(ABC):
    """Every method is ``Client``'s of the same name; ``on_progress`` is called in another thread."""

    _client: Client

    @abstractmethod
    def _run(self, work: Coroutine[Any, Any, T]) -> T:
        """The result of a coroutine, which runs on the client's loop."""

    def navigate_to(
        self,
        x_m: float | None = None,
        y_m: float | None = None,
        heading_rad: float | None = None,
        *,
        place: str | None = None,
        tolerance_m: float | None = None,
        on_progress: ProgressListener | None = None,
    ) -> str:
        """Drive to a place or a pose, and wait for the end; Ctrl-C cancels the goal."""
        goal = self._client.navigate_to(
            x_m, y_m, heading_rad, place=place, tolerance_m=tolerance_m, on_progress=on_progress
        )
        return self._run(goal)

    def follow_waypoints(self, places: list[str], *, on_progress: ProgressListener | None = None) -> str:
        """Drive to places one after the other, and wait for the end."""
        return self._run(self._client.follow_waypoints(places, on_progress=on_progress))

    def go_home(self, *, on_progress: ProgressListener | None = None) -> str:
        """Drive to the place that is the robot's home, and wait for the end."""
        return self._run(self._client.go_home(on_progress=on_progress))

    def dock(self, *, on_progress: ProgressListener | None = None) -> str:
        """Drive to the place where the robot is charged, and wait for the end."""
        return self._run(self._client.dock(on_progress=on_progress))

    def plan_to(
        self,
        x_m: float | None = None,
        y_m: float | None = None,
        heading_rad: float | None = None,
        *,
        place: str | None = None,
        tolerance_m: float | None = None,
    ) -> models.PlanResult:
        """How long the way is, how much time it takes, and whether there is one; nothing moves."""
        return self._run(self._client.plan_to(x_m, y_m, heading_rad, place=place, tolerance_m=tolerance_m))

    def cancel_navigation(self) -> None:
        """End all goals; the robot stands."""
        self._run(self._client.cancel_navigation())

    def pause_navigation(self) -> None:
        """Stand until ``resume_navigation``."""
        self._run(self._client.pause_navigation())

    def resume_navigation(self) -> None:
        """Go on."""
        self._run(self._client.resume_navigation())
