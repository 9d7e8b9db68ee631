"""The service of navigation on a bench: its worker and its driver are fakes, its clock is virtual."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from types import SimpleNamespace
from typing import Any

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.maps.models import PlaceData, PlaceList
from chefbotd.components.navigation.algorithms.arrival import ArrivalData
from chefbotd.components.navigation.events import GoalResult, NavigationChanged, NavigationData
from chefbotd.components.navigation.models import GoalParams, Waypoint
from chefbotd.components.navigation.parameters import NavigationSection
from chefbotd.components.navigation.service import NavigationService
from chefbotd.components.navigation.skill_requests import NavigateTo, NavigationRequest, Stepped
from chefbotd.core.commands import Refused
from chefbotd.core.events import ClientDisconnected, SafetyChanged
from chefbotd.core.events.robot import WorkerReported
from chefbotd.core.geometry import Twist2D
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.rpc.session import Session

HERE, THERE = Waypoint(x_m=1.2, y_m=3.4, heading_rad=0.3), Waypoint(x_m=-0.5, y_m=2.0, tolerance_m=0.2)


class FakeWorker:
    """Takes each request after ``busy_s``; ``received`` is what it has taken, ``hear`` takes what the skill tells."""

    def __init__(self) -> None:
        self.received: list[NavigationRequest] = []
        self.busy_s = 0.0
        self.is_ready = True
        self.problem: Refused | None = None
        self.hear: Callable[[Stepped], None] = lambda told: None

    def add_listener(self, skill: str, kind: type[Any], listener: Callable[[Any], None]) -> None:
        self.hear = listener if kind is Stepped else self.hear

    def add_on_ready(self, handler: Callable[[], None]) -> None:
        """It is ready from the beginning."""

    def tell(self, skill: str, body: Any) -> None:
        """Nobody looks."""

    async def request(
        self, skill: str, body: NavigationRequest, answer: type[Any], *, deadline_s: float
    ) -> Any:
        await asyncio.sleep(self.busy_s)
        if self.problem is not None:
            raise self.problem
        self.received.append(body)
        return None

    def end(self, number: int, end: str, following: int | None = None) -> None:
        """The skill tells that a goal has ended, and what it is at now."""
        state = "idle" if following is None else "driving"
        ended = (GoalResult(number, end, f"{end}: as the test says"),)
        twist, now = Twist2D(0.2, 0.1) if following else None, NavigationData(state, following)
        told = Stepped(1.0, twist, now, ended, None)
        self.hear(told)

    def step(self, number: int, distance_m: float | None = None) -> None:
        """The skill tells that it drives to a goal, and what it wishes."""
        told = Stepped(
            1.0, Twist2D(0.2, 0.1), NavigationData("driving", number, "drives", distance_m), (), None
        )
        self.hear(told)

    def think_of(self, data: ArrivalData) -> None:
        """The skill tells what it thinks now of a goal that was reached."""
        self.hear(Stepped(1.0, None, NavigationData("idle", None), (), None, data))

    def told_of(self) -> list[list[int]]:
        """The goals of each ``NavigateTo``."""
        return [
            [goal.number for goal in each.goals] for each in self.received if isinstance(each, NavigateTo)
        ]


class FakeDriver:
    """The gate; ``wished`` is what came through."""

    source, stops, stopped_by, faults = "navigation", 0, "", 0
    require_unstopped = InnerDriver.require_unstopped

    def __init__(self) -> None:
        self.wished: list[Twist2D] = []

    @property
    def stop_number(self) -> int:
        return self.stops + self.faults

    def gives_way_to(self, source: str | None) -> bool:
        return source in ("teleop", "safety")

    def begin(self, stop_number: int, what: str) -> None:
        """Only what was stopped is held."""
        self.require_unstopped(stop_number, what)

    def let_go(self) -> None:
        """Nothing is wished."""

    def state(self) -> bool:
        """It drives nothing."""
        return False

    def restore(self, state: bool) -> None:
        """It has no state."""

    def drive(self, twist: Twist2D, wished_s: float) -> None:
        self.wished.append(twist)


class Bench:
    """The service between a worker and a gate."""

    def __init__(self, section: NavigationSection) -> None:
        self.worker, self.driver, self.bus = FakeWorker(), FakeDriver(), Bus()
        places = SimpleNamespace(places=self._places)
        feed: Any = SimpleNamespace(worker=self.worker)
        driver: Any = self.driver
        self.service = NavigationService(self.bus, LoopClock(), feed, driver, places, section)
        self.told: list[NavigationChanged] = []
        self.bus.add_handler(self.told.append, NavigationChanged)
        self.localized("flat")

    def localized(self, on_map: str | None, reason: str = "") -> None:
        """Localization tells which map it uses."""
        self.bus.publish(LocalizationChanged(1.0, "uncertain", on_map, 0.0, (), 0.0, 0, reason))

    def safety(self, mode: str = "armed", source: str | None = None, reason: str = "") -> None:
        """The gate tells how it stands."""
        self.bus.publish(SafetyChanged(1.0, mode, reason, source, None, None))

    def lose_worker(self) -> None:
        """It was killed."""
        self.worker.is_ready = False
        self.bus.publish(WorkerReported(stamp_s=1.0, state="restarting", reason="it was killed by SIGKILL"))

    async def new_worker(self, on_map: str | None = "flat") -> None:
        """The next one is ready, and has its map."""
        self.worker.is_ready = True
        self.worker.received.clear()
        self.localized(on_map)
        await asyncio.sleep(1.0)

    async def _places(self, of_map: str | None) -> PlaceList:
        kitchen = PlaceData(name="kitchen", x_m=6.4, y_m=1.6, heading_rad=-1.57)
        return PlaceList(map="flat", places=(kitchen,))

    async def navigate(
        self, *waypoints: Waypoint, client: int = 1, wait: bool = True, **options: Any
    ) -> Sequence[int]:
        """Goals of a client that is to wait for them."""
        session = Session(ApiParameters(), "127.0.0.1", client, Role.DRIVE, 0.0)
        session.number = client
        params = GoalParams(wait=wait, **options)
        return await self.service.navigate_to(list(waypoints), params, session)

    def leave(self, client: int) -> None:
        """The connection of this client has ended."""
        self.bus.publish(ClientDisconnected(1.0, client))

    def wait(self, goals: Sequence[int], client: int = 1) -> "asyncio.Task[GoalResult]":
        progress: Any = SimpleNamespace(report=lambda done, total, text: None)
        return asyncio.create_task(self.service.waits.wait(goals, progress, client))


def benched(scenario: Callable[[Bench], Awaitable[None]], section: NavigationSection | None = None) -> None:
    """Run a scenario while the service tells its orders."""

    async def run() -> None:
        bench = Bench(section or NavigationSection())
        telling = asyncio.create_task(bench.service.run())
        try:
            await asyncio.wait_for(scenario(bench), 600.0)
        finally:
            telling.cancel()
            await asyncio.wait({telling})

    run_virtual(run())
