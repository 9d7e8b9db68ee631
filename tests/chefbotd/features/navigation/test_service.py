"""Goals in the daemon, one after the other, with a worker that does as the test says."""

import asyncio
import itertools
from collections.abc import Awaitable, Callable
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import SafetyChanged
from chefbotd.core.events.localization import LocalizationChanged
from chefbotd.core.events.navigation import NavigationChanged
from chefbotd.core.events.worker import WorkerReported
from chefbotd.core.geometry import Twist2D
from chefbotd.features.maps.methods import PlaceData, PlaceList
from chefbotd.features.navigation.goals import MOST_ACTIVE
from chefbotd.features.navigation.methods import GoalResult, Waypoint
from chefbotd.features.navigation.service import NavigationService
from chefbotd.navigation.section import NavigationSection
from chefbotd.worker.messages import packed
from chefbotd.worker.skills.navigation_messages import (
    GoalEnded,
    KeepGoals,
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

    def tell(self, skill: str, body: Any) -> None:
        """Nobody looks."""

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

    def step(self, number: int, distance_m: float | None = None) -> None:
        """The skill tells that it drives to a goal, and what it wishes."""
        told = Stepped(1.0, (0.2, 0.1), "driving", number, "drives", distance_m, None, (), None)
        self.hear(msgspec.msgpack.encode(told))

    def told_of(self) -> list[list[int]]:
        """The goals of each ``NavigateTo``."""
        return [
            [goal.number for goal in each.goals] for each in self.received if isinstance(each, NavigateTo)
        ]


class FakeDriver:
    """The gate; ``wished`` is what came through."""

    source, stops, stopped_by = "navigation", 0, ""

    def __init__(self) -> None:
        self.wished: list[Twist2D] = []

    def gives_way_to(self, source: str | None) -> bool:
        return source in ("teleop", "safety")

    def begin(self) -> None:
        """Nothing held it."""

    def let_go(self) -> None:
        """Nothing is wished."""

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
        self.bus.publish(LocalizationChanged(1.0, "doubtful", on_map, 0.0, (), 0.0, 0, reason))

    def safety(self, mode: str = "armed", source: str | None = None, reason: str = "") -> None:
        """The gate tells how it stands."""
        self.bus.publish(SafetyChanged(1.0, mode, reason, source, None, None))

    def lose_worker(self) -> None:
        """It was killed."""
        self.worker.is_ready = False
        self.bus.publish(WorkerReported(1.0, "restarting", None, 0, None, None, "it was killed by SIGKILL"))

    async def new_worker(self, on_map: str | None = "flat") -> None:
        """The next one is ready, and has its map."""
        self.worker.is_ready = True
        self.worker.received.clear()
        self.localized(on_map)
        await asyncio.sleep(1.0)

    async def _places(self, of_map: str | None) -> PlaceList:
        kitchen = PlaceData(name="kitchen", x_m=6.4, y_m=1.6, heading_rad=-1.57)
        return PlaceList(map="flat", places=(kitchen,))

    async def navigate(self, *waypoints: Waypoint, queue: bool = False) -> list[int]:
        return await self.service.navigate_to(list(waypoints), queue=queue)

    def wait(self, goals: list[int]) -> "asyncio.Task[GoalResult]":
        progress: Any = SimpleNamespace(report=lambda done, total, text: None)
        return asyncio.create_task(self.service.wait(goals, progress))


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
        assert bench.worker.received[-1] == KeepGoals(())

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
            bench.service.pause("a key")
            bench.service.resume()
            await asyncio.sleep(0)
        bench.service.cancel("by a key")
        assert await bench.navigate(THERE) == [2]
        kinds = [type(told) for told in bench.worker.received]
        assert kinds[-2:] == [KeepGoals, NavigateTo]
        assert len(kinds) - 1 <= 4
        assert set(kinds) <= {NavigateTo, Pause, Resume, KeepGoals}

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
        with pytest.raises(Refused, match="stopped after this goal was sent"):
            await asked
        assert not [t for t in bench.worker.received[1:] if isinstance(t, NavigateTo)]

    benched(scenario)


def test_a_goal_that_is_cancelled_while_the_worker_hangs_is_over_at_once_and_stays_so() -> None:
    """The worker answers nothing, and is killed for it 3 s later: the next one is told of no goal."""

    async def scenario(bench: Bench) -> None:
        waiting = bench.wait(await bench.navigate(HERE, THERE))
        bench.worker.busy_s = 20.0
        await asyncio.sleep(0.1)
        bench.service.cancel("by a key")
        found = await asyncio.wait_for(waiting, 0.1)
        assert (found.end, found.reason) == ("cancelled", "cancelled: by a key")
        bench.worker.step(1)  # it has not heard of it
        assert bench.driver.wished == []
        assert bench.told[-1].state == "cancelled"
        bench.worker.busy_s = 0.0
        bench.lose_worker()
        await bench.new_worker()
        assert bench.worker.told_of() == []

    benched(scenario)


def test_a_robot_that_is_disarmed_while_it_has_no_worker_does_not_go_on() -> None:
    """Disarmed and armed again between two workers: the goals ended with it, each with a sentence."""

    async def scenario(bench: Bench) -> None:
        waiting = bench.wait(await bench.navigate(HERE, THERE))
        bench.lose_worker()
        bench.safety("disarmed", reason="the link was lost")
        found = await asyncio.wait_for(waiting, 0.1)
        assert (found.end, found.reason) == ("fault", "fault: the robot is disarmed: the link was lost")
        assert [(each.goal, each.state) for each in bench.told[-2:]] == [(2, "cancelled"), (1, "fault")]
        bench.safety("armed")
        await bench.new_worker()
        assert bench.worker.told_of() == []

    benched(scenario)


@pytest.mark.parametrize(("on_map", "reason"), [(None, "it was deleted"), ("other", "")])
def test_goals_end_where_the_next_worker_has_no_such_map(on_map: str | None, reason: str) -> None:
    """The map was deleted, or another one loaded, while there was no worker: a fault, and no waiting for ever."""

    async def scenario(bench: Bench) -> None:
        waiting = bench.wait(await bench.navigate(HERE))
        bench.lose_worker()
        bench.worker.is_ready = True
        bench.localized(on_map, reason)
        found = await asyncio.wait_for(waiting, 0.1)
        assert found.end == "fault"
        assert "the map 'flat', which is no longer in use" in found.reason
        assert reason in found.reason

    benched(scenario)


def test_a_goal_that_is_queued_behind_a_paused_one_does_not_end_the_pause() -> None:
    """Nor does one that is refused; and a new worker is told of the pause too."""

    async def scenario(bench: Bench) -> None:
        await bench.navigate(HERE)
        bench.service.pause("a key")
        await asyncio.sleep(0.1)
        await bench.navigate(THERE, queue=True)
        bench.worker.problem = Refused(RefusalKind.POSE_UNKNOWN, "the lidar is turned")
        with pytest.raises(Refused, match="the lidar is turned"):
            await bench.navigate(THERE)
        bench.worker.problem = None
        bench.worker.step(1)
        assert bench.driver.wished == []
        bench.safety(source="teleop")
        bench.safety()
        await asyncio.sleep(0.1)
        assert not [each for each in bench.worker.received if isinstance(each, Resume)]
        bench.lose_worker()
        await bench.new_worker()
        assert bench.worker.received[-1] == Pause("paused by a key")
        assert bench.worker.told_of() == [[1, 2]]

    benched(scenario)


def test_a_goal_that_is_sent_while_somebody_drives_waits_until_he_lets_go() -> None:
    """Otherwise it would fail, for the robot makes no progress: teleop has the wheels."""

    async def scenario(bench: Bench) -> None:
        bench.safety(source="teleop")
        await bench.navigate(HERE)
        await asyncio.sleep(0.1)
        assert bench.worker.received[-1] == Pause("paused, because teleop has control")
        bench.service.resume()
        await asyncio.sleep(0.1)
        assert isinstance(bench.worker.received[-1], Pause)
        bench.safety()
        await asyncio.sleep(0.1)
        assert bench.worker.received[-1] == Resume()

    benched(scenario)


def test_a_lower_source_takes_nothing_over() -> None:
    """It drives while navigation is paused; ``resume`` ends that."""

    async def scenario(bench: Bench) -> None:
        await bench.navigate(HERE)
        bench.service.pause("a key")
        bench.safety(source="docking")
        bench.service.resume()
        await asyncio.sleep(0.1)
        assert bench.worker.received[-1] == Resume()

    benched(scenario)


def test_where_a_takeover_waits_for_resume_a_new_worker_waits_for_it_too() -> None:
    """``navigation.resume_after_takeover`` is false: neither the end of teleop nor a new worker go on."""

    async def scenario(bench: Bench) -> None:
        await bench.navigate(HERE)
        bench.safety(source="teleop")
        bench.safety()
        bench.lose_worker()
        await bench.new_worker()
        assert isinstance(bench.worker.received[-1], Pause)
        bench.worker.step(1)
        assert bench.driver.wished == []
        bench.service.resume()
        await asyncio.sleep(0.1)
        assert bench.worker.received[-1] == Resume()

    benched(scenario, NavigationSection(resume_after_takeover=False))


def test_who_gives_up_a_queued_goal_does_not_end_that_of_somebody_else() -> None:
    """Two clients: the second one's queued goal and what follows it are gone, the first one's goes on."""

    async def scenario(bench: Bench) -> None:
        first = bench.wait(await bench.navigate(HERE))
        second = bench.wait(await bench.navigate(THERE, queue=True))
        third = bench.wait(await bench.navigate(HERE, queue=True))
        await asyncio.sleep(0.1)
        second.cancel()
        assert (await third).end == "cancelled"
        await asyncio.sleep(0.1)
        assert bench.worker.received[-1] == KeepGoals((1,))
        bench.worker.step(1)
        assert len(bench.driver.wished) == 1
        bench.worker.end(1, "reached")
        assert (await first).end == "reached"

    benched(scenario)


def test_a_new_goal_ends_those_before_also_where_the_worker_dies_before_it_says_so() -> None:
    """The next worker is told of the new goal alone."""

    async def scenario(bench: Bench) -> None:
        first = bench.wait(await bench.navigate(HERE, THERE))
        await bench.navigate(THERE)
        assert (await asyncio.wait_for(first, 0.1)).reason == "cancelled: a new goal replaced it"
        bench.lose_worker()
        await bench.new_worker()
        assert bench.worker.told_of() == [[3]]

    benched(scenario)


@pytest.mark.parametrize("is_heard_of", [True, False])
def test_a_goal_does_not_wait_for_ever_for_a_worker_that_cannot_start(*, is_heard_of: bool) -> None:
    """None of five lives to be ready; or the first hangs as it starts, and after three minutes that is the end."""

    async def scenario(bench: Bench) -> None:
        waiting = bench.wait(await bench.navigate(HERE, THERE))
        bench.lose_worker()
        for _ in range(3 if is_heard_of else 0):
            await asyncio.sleep(8.0)
            bench.lose_worker()
        await asyncio.sleep(179.0 - 24.0 * is_heard_of)
        assert not waiting.done()
        assert bench.told[-1].state == "paused"
        if is_heard_of:
            bench.lose_worker()
        found = await asyncio.wait_for(waiting, 1.1)
        why = (
            "5 workers ended on the way to it, the last: it was killed"
            if is_heard_of
            else "no worker could take over the goal for 180 s"
        )
        assert found.end == "fault"
        assert why in found.reason
        await bench.new_worker()
        assert bench.worker.told_of() == []

    benched(scenario)


def test_a_goal_survives_two_workers_in_a_row_and_not_five() -> None:
    """The second dies while it is being told; the fifth on the way to the same goal is the last."""

    async def scenario(bench: Bench) -> None:
        waiting = bench.wait(await bench.navigate(HERE))
        bench.lose_worker()
        bench.worker.problem = Refused(RefusalKind.WORKER_UNAVAILABLE, "the worker ended before it was done")
        await bench.new_worker()
        bench.worker.problem = None
        await bench.new_worker()
        assert bench.worker.told_of() == [[1]]
        for _ in range(3):
            bench.lose_worker()
            await bench.new_worker()
        assert not waiting.done()
        bench.lose_worker()
        found = await asyncio.wait_for(waiting, 0.1)
        assert found.end == "fault"
        assert "5 workers ended on the way to it, the last: it was killed by SIGKILL" in found.reason

    benched(scenario)


def test_a_request_that_is_given_up_before_it_was_accepted_leaves_no_goal_behind() -> None:
    """The worker may have taken it all the same: it is told which goals are left."""

    async def scenario(bench: Bench) -> None:
        await bench.navigate(HERE)
        bench.worker.busy_s = 5.0
        asked = asyncio.create_task(bench.navigate(THERE, queue=True))
        await asyncio.sleep(1.0)
        asked.cancel()
        await asyncio.sleep(6.0)
        assert bench.worker.received[-1] == KeepGoals((1,))

    benched(scenario)


def test_who_waits_is_told_how_far_it_is_of_how_much() -> None:
    """4 m at first, 1.5 m left of them; a way round of 5 m; and of the goal before one's own nothing is counted."""

    async def scenario(bench: Bench) -> None:
        told: list[tuple[float, float]] = []
        progress: Any = SimpleNamespace(report=lambda done, total, text: told.append((done, total)))
        goals = await bench.navigate(HERE, THERE)
        waiting = asyncio.create_task(bench.service.wait(goals[1:], progress))
        await asyncio.sleep(0)
        for number, left_m in ((1, 7.0), (2, 4.0), (2, 1.5), (2, 5.0), (2, 4.5)):
            await asyncio.sleep(1.0)
            bench.worker.step(number, left_m)
        assert [each for each, _ in itertools.groupby(told)] == [
            (0.0, 0.0),
            (0.0, 4.0),
            (2.5, 4.0),
            (0.0, 5.0),
            (0.5, 5.0),
        ]
        waiting.cancel()

    benched(scenario)


def test_who_waits_for_a_paused_goal_hears_that_it_has_not_ended() -> None:
    """A client gives up what is silent for 5 s, and its goal with it: a pause of a minute is no silence."""

    async def scenario(bench: Bench) -> None:
        told: list[float] = []
        progress: Any = SimpleNamespace(
            report=lambda done, total, text: told.append(asyncio.get_running_loop().time())
        )
        goals = await bench.navigate(HERE)
        waiting = asyncio.create_task(bench.service.wait(goals, progress))
        await asyncio.sleep(0)
        bench.worker.step(1, 4.0)
        bench.service.pause("a key")
        began_s = asyncio.get_running_loop().time()
        await asyncio.sleep(40.0)
        gaps = [b - a for a, b in itertools.pairwise([began_s, *told[1:], began_s + 40.0])]
        assert max(gaps) < 2.5
        bench.worker.end(1, "reached")
        await waiting
        count = len(told)
        await asyncio.sleep(10.0)
        assert len(told) == count

    benched(scenario)
