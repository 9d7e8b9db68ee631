"""Goals by an id that the client chose, with whom they end, and the cause of each end."""

import asyncio

import pytest

from chefbotd.components.navigation.events import GoalCause, GoalReport
from chefbotd.components.navigation.goals import MOST_ENDED, NOT_ACCEPTED
from chefbotd.core.commands import RefusalKind, Refused
from tests.chefbotd.components.navigation.bench import HERE, THERE, Bench, benched


def test_the_same_id_again_begins_nothing_and_answers_with_its_goal() -> None:
    """While it drives, and after its end; another id is another goal."""

    async def scenario(bench: Bench) -> None:
        assert await bench.navigate(HERE, goal_id="order 1") == [1]
        assert tuple(await bench.navigate(THERE, goal_id="order 1")) == (1,)
        bench.worker.end(1, "blocked")
        again = await bench.navigate(HERE, goal_id="order 1")
        ended = bench.service.result(again)
        assert (ended.goal, ended.end, ended.goal_id) == (1, "blocked", "order 1")
        assert await bench.navigate(HERE, goal_id="order 2") == [2]
        assert bench.worker.told_of() == [[1], [2]]

    benched(scenario)


def test_the_same_id_while_its_goal_is_being_accepted_is_the_same_goal() -> None:
    """The worker takes 3 s to accept it: the second request waits for the end of the first one's goal."""

    async def scenario(bench: Bench) -> None:
        bench.worker.busy_s = 3.0
        first = asyncio.create_task(bench.navigate(HERE, goal_id="order 1"))
        await asyncio.sleep(1.0)
        second = await bench.navigate(HERE, goal_id="order 1")
        assert bench.service.report(None, "order 1").state == "waiting"
        waiting = bench.wait(second)
        assert tuple(await first) == tuple(second) == (1,)
        bench.worker.end(1, "reached")
        assert (await waiting).end == "reached"
        assert bench.worker.told_of() == [[1]]

    benched(scenario)


def test_an_id_whose_goal_was_refused_is_free_again_and_who_waits_for_it_is_told() -> None:
    """The worker refuses after 3 s; the second request of that id, which waits, ends as not accepted."""

    async def scenario(bench: Bench) -> None:
        bench.worker.busy_s, bench.worker.problem = 3.0, Refused(RefusalKind.NO_MAP_LOADED, "no map")
        first = asyncio.create_task(bench.navigate(HERE, goal_id="order 1"))
        await asyncio.sleep(1.0)
        waiting = bench.wait(await bench.navigate(HERE, goal_id="order 1"))
        with pytest.raises(Refused, match="no map"):
            await first
        ended = await waiting
        assert (ended.end, ended.reason, ended.cause) == ("cancelled", NOT_ACCEPTED, GoalCause.REFUSED)
        bench.worker.busy_s, bench.worker.problem = 0.0, None
        assert await bench.navigate(HERE, goal_id="order 1") == [2]

    benched(scenario)


def test_the_state_and_the_end_of_a_goal_are_told_by_number_and_by_id() -> None:
    """Driving, waiting behind it, ended; the end of two waypoints is that of the first that was not reached."""

    async def scenario(bench: Bench) -> None:
        await bench.navigate(HERE)
        await bench.navigate(HERE, THERE, queue=True, goal_id="round")
        bench.worker.step(1, 4.0)
        assert bench.service.report(1, None) == GoalReport(goal=1, state="driving")
        assert bench.service.report(None, "round") == GoalReport(goal=3, goal_id="round", state="waiting")
        bench.worker.end(1, "reached", following=2)
        bench.worker.end(2, "unreachable")
        told = bench.service.report(None, "round")
        assert (told.goal, told.state, told.end, told.cause) == (2, "ended", "unreachable", None)
        assert bench.service.report(2, None) == told

    benched(scenario)


def test_what_nobody_remembers_is_refused_as_unknown() -> None:
    """A number and an id that never were, and the first of one more than are remembered."""

    async def scenario(bench: Bench) -> None:
        for number in range(1, MOST_ENDED + 2):
            await bench.navigate(HERE, goal_id=f"order {number}")
            bench.worker.end(number, "reached")
        await bench.navigate(HERE)
        for goal, goal_id in ((7000, None), (1, None), (None, "order 1"), (None, "nobody's")):
            with pytest.raises(Refused, match="remembered") as refused:
                bench.service.report(goal, goal_id)
            assert refused.value.kind is RefusalKind.UNKNOWN_GOAL
        assert bench.service.report(None, "order 2").end == "reached"

    benched(scenario)


@pytest.mark.parametrize(
    ("on_client_left", "wait", "ends"),
    [(None, True, True), (None, False, False), ("cancel", False, True), ("keep", True, False)],
)
def test_a_goal_ends_with_its_client_as_it_says(on_client_left: str | None, wait: bool, ends: bool) -> None:
    """Without a word, one that is waited for does, and one that is not goes on; else as the goal says."""

    async def scenario(bench: Bench) -> None:
        goals = await bench.navigate(HERE, wait=wait, on_client_left=on_client_left)
        waiting = bench.wait(goals) if wait else None
        await asyncio.sleep(0)
        bench.leave(2)
        assert bench.service.report(1, None).end is None
        bench.leave(1)
        if waiting is not None:
            waiting.cancel()
            await asyncio.wait([waiting])
        told = bench.service.report(1, None)
        expected = ("cancelled", GoalCause.CLIENT_LEFT) if ends else (None, None)
        assert (told.end, told.cause) == expected

    benched(scenario)


def test_a_goal_that_another_client_took_up_does_not_end_with_the_first() -> None:
    """An application was started again; that its old connection ends, and its old request, harms nothing."""

    async def scenario(bench: Bench) -> None:
        old = bench.wait(await bench.navigate(HERE, client=1, goal_id="order 1"), client=1)
        await asyncio.sleep(0)
        new = bench.wait(await bench.navigate(HERE, client=2, goal_id="order 1"), client=2)
        await asyncio.sleep(0)
        bench.leave(1)
        old.cancel()
        await asyncio.wait([old])
        bench.worker.end(1, "reached")
        assert (await new).end == "reached"

    benched(scenario)


def test_each_end_that_came_from_outside_names_its_cause() -> None:
    """Asked for, by another goal, by a stop, with the request, by an earlier goal, by an e-stop."""

    async def scenario(bench: Bench) -> None:
        causes: list[tuple[str | None, GoalCause | None, str]] = []

        def note(goal: int) -> None:
            told = bench.service.report(goal, None)
            causes.append((told.end, told.cause, told.by))

        await bench.navigate(HERE)
        bench.service.cancel("by Ann", GoalCause.ASKED, "Ann")
        note(1)
        await bench.navigate(HERE)
        await bench.navigate(THERE, client=7)
        note(2)
        bench.driver.stops, bench.driver.stopped_by = 1, "Ben"
        bench.worker.step(3)
        note(3)
        waiting = bench.wait(await bench.navigate(HERE))
        await asyncio.sleep(0)
        waiting.cancel()
        await asyncio.wait([waiting])
        note(4)
        await bench.navigate(HERE, THERE)
        bench.safety("estopped", reason="a child")
        note(5)
        note(6)
        assert causes == [
            ("cancelled", GoalCause.ASKED, "Ann"),
            ("cancelled", GoalCause.REPLACED, "127.0.0.1:7"),
            ("cancelled", GoalCause.STOPPED, "Ben"),
            ("cancelled", GoalCause.REQUEST_CANCELLED, ""),
            ("fault", GoalCause.NOT_ARMED, ""),
            ("cancelled", GoalCause.EARLIER_GOAL, ""),
        ]
        assert bench.told[-1].cause is GoalCause.NOT_ARMED

    benched(scenario)


def test_goals_and_their_ids_are_the_same_after_a_restore() -> None:
    """One ended, one drives: another service knows both by their ids, and with whom the second ends."""

    async def scenario(bench: Bench) -> None:
        await bench.navigate(HERE, goal_id="order 1")
        bench.worker.end(1, "reached")
        await bench.navigate(THERE, client=4, goal_id="order 2")
        other = Bench(bench.service.section)
        other.service.restore(bench.service.state())
        assert other.service.report(None, "order 1").end == "reached"
        assert tuple(await other.navigate(HERE, client=4, goal_id="order 2")) == (2,)
        other.leave(4)
        assert other.service.report(None, "order 2").cause is GoalCause.CLIENT_LEFT

    benched(scenario)


def test_the_goals_that_have_not_ended_are_listed_in_their_order() -> None:
    """Each with its pose, and the id of its request; one that has ended is on the list no more."""

    async def scenario(bench: Bench) -> None:
        await bench.navigate(HERE)
        await bench.navigate(HERE, THERE, queue=True, goal_id="round")
        listed = bench.service.active_goals().goals
        assert [(each.goal, each.goal_id) for each in listed] == [(1, None), (2, "round"), (3, "round")]
        assert [(each.x_m, each.y_m) for each in listed[1:]] == [(HERE.x_m, HERE.y_m), (THERE.x_m, THERE.y_m)]
        bench.worker.end(1, "reached")
        assert [each.goal for each in bench.service.active_goals().goals] == [2, 3]

    benched(scenario)
