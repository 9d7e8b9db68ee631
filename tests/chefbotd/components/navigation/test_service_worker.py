"""The service of navigation while its worker is busy, hangs or is gone."""

import asyncio

import pytest

from chefbotd.components.navigation.events import GoalCause
from chefbotd.components.navigation.parameters import NavigationSection
from chefbotd.components.navigation.skill_requests import KeepGoals, NavigateTo, Pause, Resume
from chefbotd.core.commands import RefusalKind, Refused
from tests.chefbotd.components.navigation.bench import HERE, THERE, Bench, benched


def test_while_the_worker_hangs_orders_do_not_pile_up_and_a_goal_does_not_overtake_a_cancel() -> None:
    """Five seconds for each request; a hundred times pause and resume, a cancel, and then a goal."""

    async def scenario(bench: Bench) -> None:
        await bench.navigate(HERE)
        bench.worker.busy_s = 5.0
        for _ in range(100):
            bench.service.pause("a key")
            bench.service.resume()
            await asyncio.sleep(0)
        bench.service.cancel("by a key", GoalCause.ASKED)
        assert await bench.navigate(THERE) == [2]
        kinds = [type(told) for told in bench.worker.received]
        assert kinds[-2:] == [KeepGoals, NavigateTo]
        assert len(kinds) - 1 <= 4
        assert set(kinds) <= {NavigateTo, Pause, Resume, KeepGoals}

    benched(scenario)


@pytest.mark.parametrize("what", ["stops", "faults"])
def test_a_stop_while_a_goal_waits_for_a_busy_worker_voids_it_whatever_the_worker_tells_meanwhile(
    what: str,
) -> None:
    """A goal waits 5 s behind a cancel; a stop, or a fault and an arm, comes, then a step of the worker."""

    async def scenario(bench: Bench) -> None:
        await bench.navigate(HERE)
        bench.worker.busy_s = 5.0
        bench.service.cancel("by a key", GoalCause.ASKED)
        asked = asyncio.create_task(bench.navigate(THERE))
        await asyncio.sleep(1.0)
        setattr(bench.driver, what, 1)
        bench.safety()
        bench.worker.end(1, "cancelled")
        with pytest.raises(Refused, match="stopped after this goal was sent"):
            await asked
        assert not [t for t in bench.worker.received[1:] if isinstance(t, NavigateTo)]

    benched(scenario)


@pytest.mark.parametrize("what", ["stops", "faults"])
def test_at_each_of_100_moments_a_stop_or_a_fault_voids_a_goal_that_waits_for_a_busy_worker(
    what: str,
) -> None:
    """It waits for 2 s; the robot is stopped in each 0.02 s of them, and armed at once: 100 of 100 are refused."""

    async def scenario(bench: Bench) -> None:
        for number in range(100):
            await bench.navigate(HERE)
            bench.worker.busy_s = 2.0
            bench.service.cancel("by a key", GoalCause.ASKED)
            asked = asyncio.create_task(bench.navigate(THERE))
            await asyncio.sleep(0.019 * number + 0.01)
            setattr(bench.driver, what, getattr(bench.driver, what) + 1)
            bench.safety()
            with pytest.raises(Refused, match="stopped after this goal was sent"):
                await asked
            bench.worker.busy_s = 0.0
            await asyncio.sleep(1.0)
        goals = [goals[0] for goals in bench.worker.told_of()]
        assert goals == [2 * number + 1 for number in range(100)]

    benched(scenario)


def test_a_goal_that_is_cancelled_while_the_worker_hangs_is_over_at_once_and_stays_so() -> None:
    """The worker answers nothing, and is killed for it 3 s later: the next one is told of no goal."""

    async def scenario(bench: Bench) -> None:
        waiting = bench.wait(await bench.navigate(HERE, THERE))
        bench.worker.busy_s = 20.0
        await asyncio.sleep(0.1)
        bench.service.cancel("by a key", GoalCause.ASKED)
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
        assert (found.end, found.reason) == ("fault", "fault: the robot is stopped (the link was lost)")
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
