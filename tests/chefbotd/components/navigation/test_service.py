"""Goals in the daemon, one after the other, with a worker that does as the test says."""

import asyncio
import itertools
import json
from types import SimpleNamespace
from typing import Any

import pytest

from chefbotd.components.navigation.algorithms.arrival import ArrivalData, ArrivalState
from chefbotd.components.navigation.events import ArrivalChanged, GoalResult
from chefbotd.components.navigation.goals import MOST_ACTIVE
from chefbotd.components.navigation.models import Waypoint
from chefbotd.components.navigation.skill_requests import KeepGoals, NavigateTo, Pause, Resume
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import Twist2D
from tests.chefbotd.components.navigation.bench import HERE, THERE, Bench, benched


def test_the_speed_limit_of_each_goal_is_told() -> None:
    """To a pose and to a place; a goal without one has none."""

    async def scenario(bench: Bench) -> None:
        slow = HERE.model_copy(update={"max_speed_m_s": 0.2})
        await bench.navigate(slow, Waypoint(place="kitchen", max_speed_m_s=0.1), THERE)
        told = bench.worker.received[0]
        assert isinstance(told, NavigateTo)
        assert [goal.max_speed_m_s for goal in told.goals] == [0.2, 0.1, None]

    benched(scenario)


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


def test_a_goal_without_a_map_is_refused_with_what_became_of_the_one_that_was_in_use() -> None:
    """The worker knows only that it has none; localization said that the map had ended the worker."""

    async def scenario(bench: Bench) -> None:
        bench.localized(None, "the map large is not used any more, as it ended the worker: it took 900 MB")
        bench.worker.problem = Refused(RefusalKind.NO_MAP_LOADED, "no finished map is in use")
        with pytest.raises(Refused, match=r"no finished map is in use \(the map large .* it took 900 MB\)"):
            await bench.navigate(HERE)
        bench.localized("flat")
        with pytest.raises(Refused, match=r"no finished map is in use$"):
            await bench.navigate(HERE)

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
        said = {"id": "navigation.paused_by", "arguments": {"by": "a key"}}
        assert bench.worker.received[-1] == Pause("paused by a key", json.dumps(said))
        assert bench.worker.told_of() == [[1, 2]]

    benched(scenario)


def test_a_goal_that_is_sent_while_somebody_drives_waits_until_he_lets_go() -> None:
    """Otherwise it would fail, for the robot makes no progress: teleop has the wheels."""

    async def scenario(bench: Bench) -> None:
        bench.safety(source="teleop")
        await bench.navigate(HERE)
        await asyncio.sleep(0.1)
        said = {"id": "navigation.taken_over", "arguments": {"source": "teleop"}}
        assert bench.worker.received[-1] == Pause("paused, because teleop has control", json.dumps(said))
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
        waiting = asyncio.create_task(bench.service.waits.wait(goals[1:], progress, 1))
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
        waiting = asyncio.create_task(bench.service.waits.wait(goals, progress, 1))
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


def test_a_goal_that_was_reached_by_a_wrong_pose_is_told_on_its_topic_and_by_get_goal_and_as_the_reason() -> (
    None
):
    """Its end stays, since that was answered. While another goal is under way the reason is that one's."""

    async def scenario(bench: Bench) -> None:
        heard = list[ArrivalChanged]()
        bench.bus.add_handler(heard.append, ArrivalChanged)
        await bench.navigate(HERE)
        bench.worker.end(1, "reached")
        bench.worker.think_of(ArrivalData(1, ArrivalState.DOUBTED, "it may not have been there"))
        assert (bench.told[-1].state, bench.told[-1].reason) == ("reached", "it may not have been there")
        await bench.navigate(THERE)
        bench.worker.step(2, 3.0)
        bench.worker.think_of(ArrivalData(1, ArrivalState.WRONG, "it was elsewhere", 3.0, 4.0, 1.5))
        assert bench.told[-1].goal == 2
        assert [(event.goal, event.arrival, event.off_m) for event in heard] == [
            (1, ArrivalState.DOUBTED, None), (1, ArrivalState.WRONG, 3.0),
        ]  # fmt: skip
        report = bench.service.report(1, None)
        assert (report.end, report.arrival, report.off_m) == ("reached", ArrivalState.WRONG, 3.0)

    benched(scenario)
