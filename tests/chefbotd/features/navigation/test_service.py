"""Goals in the daemon, one after the other, with a worker that does as the test says."""

import asyncio
from collections.abc import Awaitable, Callable
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import Twist2D
from chefbotd.features.maps.methods import PlaceData, PlaceList
from chefbotd.features.navigation.goals import MOST_ACTIVE
from chefbotd.features.navigation.methods import GoalResult, Waypoint
from chefbotd.features.navigation.service import NavigationService
from chefbotd.navigation.section import NavigationSection
from chefbotd.worker.messages import packed
from chefbotd.worker.skills.navigation_messages import (
    CancelGoals,
    GoalEnded,
    NavigateTo,
    NavigationRequest,
    Pause,
    Resume,
    Stepped,
    Taken,
)


class FakeWorker:
    """Takes each request after ``busy_s``; ``received`` is what it has taken, ``hear`` takes what the skill tells."""

    def __init__(self) -> None:
        self.received: list[NavigationRequest] = []
        self.busy_s = 0.0
        self.is_ready = True
        self.problem: Refused | None = None
        self.hear: Callable[[bytes], None] = lambda body: None

    def add_listener(self, skill: str, listener: Callable[[bytes], None]) -> None:
        self.hear = listener

    def add_on_ready(self, handler: Callable[[], None]) -> None:
        """It is ready from the beginning."""

    async def request(self, skill: str, body: NavigationRequest, *, deadline_s: float) -> bytes:
        await asyncio.sleep(self.busy_s)
        if self.problem is not None:
            raise self.problem
        self.received.append(body)
        return packed(Taken())

    def end(self, number: int, end: str, following: int | None = None) -> None:
        """The skill tells that a goal has ended, and what it is at now."""
        state = "idle" if following is None else "driving"
        ended = (GoalEnded(number, end, f"{end}: as the test says"),)
        told = Stepped(1.0, (0.2, 0.1) if following else None, state, following, "", None, None, ended, None)
        self.hear(msgspec.msgpack.encode(told))


class FakeDriver:
    """The gate; ``wished`` is what came through."""

    source, stops, stopped_by = "navigation", 0, ""

    def __init__(self) -> None:
        self.wished: list[Twist2D] = []

    def begin(self) -> None:
        """Nothing held it."""

    def let_go(self) -> None:
        """Nothing is wished."""

    def drive(self, twist: Twist2D, wished_s: float) -> None:
        self.wished.append(twist)


class Bench:
    """The service between a worker and a gate."""

    def __init__(self) -> None:
        self.worker, self.driver = FakeWorker(), FakeDriver()
        places = SimpleNamespace(places=self._places)
        feed: Any = SimpleNamespace(worker=self.worker)
        driver: Any = self.driver
        self.service = NavigationService(Bus(), LoopClock(), feed, driver, places, NavigationSection())

    async def _places(self, of_map: str | None) -> PlaceList:
        kitchen = PlaceData(name="kitchen", x_m=6.4, y_m=1.6, heading_rad=-1.57)
        return PlaceList(map="flat", places=(kitchen,))

    async def navigate(self, *waypoints: Waypoint, queue: bool = False) -> list[int]:
        return await self.service.navigate_to(list(waypoints), queue=queue)

    def wait(self, goals: list[int]) -> "asyncio.Task[GoalResult]":
        progress: Any = SimpleNamespace(report=lambda done, total, text: None)
        return asyncio.create_task(self.service.wait(goals, progress))


def benched(scenario: Callable[[Bench], Awaitable[None]]) -> None:
    """Run a scenario while the service tells its orders."""

    async def run() -> None:
        bench = Bench()
        telling = asyncio.create_task(bench.service.run())
        try:
            await asyncio.wait_for(scenario(bench), 60.0)
        finally:
            telling.cancel()
            await asyncio.wait({telling})

    run_virtual(run())


HERE, THERE = Waypoint(x_m=1.2, y_m=3.4, heading_rad=0.3), Waypoint(x_m=-0.5, y_m=2.0, tolerance_m=0.2)


def test_waypoints_are_told_together_and_the_wait_ends_with_the_last() -> None:
    """A pose, a place and another pose: three numbers in order; after two the request still waits."""

    async def scenario(bench: Bench) -> None:
        goals = await bench.navigate(HERE, Waypoint(place="kitchen"), THERE)
        assert goals == [1, 2, 3]
        told = bench.worker.received[0]
        assert isinstance(told, NavigateTo)
        assert not told.queue
        assert [(goal.number, goal.x_m, goal.heading_rad) for goal in told.goals] == [
            (1, 1.2, 0.3), (2, 6.4, -1.57), (3, -0.5, None),
        ]  # fmt: skip
        waiting = bench.wait(goals)
        bench.worker.end(1, "reached", following=2)
        bench.worker.end(2, "reached", following=3)
        await asyncio.sleep(1.0)
        assert not waiting.done()
        bench.worker.end(3, "reached")
        assert await waiting == GoalResult(goal=3, end="reached", reason="reached: as the test says")

    benched(scenario)


def test_the_first_waypoint_that_is_not_reached_ends_the_wait() -> None:
    """The second is blocked: the answer is its own end, not that of those after it."""

    async def scenario(bench: Bench) -> None:
        waiting = bench.wait(await bench.navigate(HERE, THERE, HERE))
        await asyncio.sleep(0)
        bench.worker.end(1, "reached", following=2)
        bench.worker.end(2, "blocked")
        bench.worker.end(3, "cancelled")
        found = await waiting
        assert (found.goal, found.end) == (2, "blocked")

    benched(scenario)


def test_a_queued_goal_is_told_as_such_and_outlives_the_end_of_the_one_before() -> None:
    """Each has its own number and end; the wheels keep turning between them."""

    async def scenario(bench: Bench) -> None:
        first = bench.wait(await bench.navigate(HERE))
        second = bench.wait(await bench.navigate(THERE, queue=True))
        await asyncio.sleep(0)
        assert [told.queue for told in bench.worker.received if isinstance(told, NavigateTo)] == [False, True]
        bench.worker.end(1, "reached", following=2)
        assert (await first).goal == 1
        assert not second.done()
        assert bench.driver.wished == [Twist2D(0.2, 0.1)]
        bench.worker.end(2, "unreachable")
        assert (await second).end == "unreachable"

    benched(scenario)


def test_giving_up_the_wait_for_waypoints_cancels_them() -> None:
    """The client that waited is gone: nobody would know where the robot goes to."""

    async def scenario(bench: Bench) -> None:
        waiting = bench.wait(await bench.navigate(HERE, THERE))
        await asyncio.sleep(0.1)
        waiting.cancel()
        await asyncio.sleep(0.1)
        assert isinstance(bench.worker.received[-1], CancelGoals)

    benched(scenario)


def test_more_goals_than_there_is_room_for_are_refused_and_those_before_stay() -> None:
    """And a goal that the worker refuses is no goal."""

    async def scenario(bench: Bench) -> None:
        for _ in range(MOST_ACTIVE // 50):
            await bench.navigate(*[HERE] * 50, queue=True)
        with pytest.raises(Refused, match=f"at most {MOST_ACTIVE} goals"):
            await bench.navigate(THERE, queue=True)
        bench.worker.end(1, "reached", following=2)
        bench.worker.problem = Refused(RefusalKind.NO_MAP_LOADED, "no map is in use")
        with pytest.raises(Refused, match="no map is in use"):
            await bench.navigate(THERE, queue=True)
        bench.worker.problem = None
        await bench.navigate(THERE, queue=True)

    benched(scenario)


def test_while_the_worker_hangs_orders_do_not_pile_up_and_a_goal_does_not_overtake_a_cancel() -> None:
    """Five seconds for each request; a hundred times pause and resume, a cancel, and then a goal."""

    async def scenario(bench: Bench) -> None:
        await bench.navigate(HERE)
        bench.worker.busy_s = 5.0
        for _ in range(100):
            bench.service.pause()
            bench.service.resume()
            await asyncio.sleep(0)
        bench.service.cancel("by a key")
        assert await bench.navigate(THERE) == [2]
        kinds = [type(told) for told in bench.worker.received]
        assert kinds[-2:] == [CancelGoals, NavigateTo]
        assert len(kinds) - 1 <= 4
        assert set(kinds) <= {NavigateTo, Pause, Resume, CancelGoals}

    benched(scenario)


def test_a_stop_while_a_goal_waits_for_a_busy_worker_voids_it_whatever_the_worker_tells_meanwhile() -> None:
    """A goal waits 5 s behind a cancel; a stop comes, and the worker tells of a step after it: nothing is driven."""

    async def scenario(bench: Bench) -> None:
        await bench.navigate(HERE)
        bench.worker.busy_s = 5.0
        bench.service.cancel("by a key")
        asked = asyncio.create_task(bench.navigate(THERE))
        await asyncio.sleep(1.0)
        bench.driver.stops = 1
        bench.worker.end(1, "cancelled")
        with pytest.raises(Refused, match="stopped after this goal was asked for"):
            await asked
        assert not [t for t in bench.worker.received[1:] if isinstance(t, NavigateTo)]

    benched(scenario)
