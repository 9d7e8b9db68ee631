"""Sending the robot somewhere with the client: what is asked, how it ends, and what giving up does."""

import asyncio

import pytest

from chefbotd.client import CallError, Client, GoalBlocked
from chefbotd.clock import run_virtual
from chefbotd.components.navigation.events import GoalResult
from chefbotd.rpc.jobs import ProgressReporter
from tests.fakes.api import serving
from tests.fakes.robot import FakeNavigation
from tests.waiting import until


def test_goals_are_queued_as_asked() -> None:
    """Without a word about it the daemon's own default holds."""

    async def ask() -> None:
        async with serving() as served, Client.connect(served.host, served.port) as robot:
            await robot.navigate_to(1.2, 3.4, queue=True)
            await robot.navigate_to(place="table 3")
            await robot.follow_waypoints(["hall", "kitchen"], queue=True)
            assert [call for call in served.robot.calls if call[0] == "navigate_to"] == [
                ("navigate_to", [{"x_m": 1.2, "y_m": 3.4, "queue": True, "wait": True}], True),
                ("navigate_to", [{"place": "table 3", "wait": True}], False),
                ("navigate_to", [{"place": "hall"}, {"place": "kitchen"}], True),
            ]

    run_virtual(ask())


def test_giving_up_a_goal_cancels_that_request_and_nobody_elses_goals(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two programs wait; the second is ended by Ctrl-C. ``cancel_navigation`` would end the first one's goal too."""
    waited_for: list[list[int]] = []
    given_up: list[list[int]] = []

    async def waits(
        self: FakeNavigation, goals: list[int], progress: ProgressReporter, client: int
    ) -> GoalResult:
        waited_for.append(goals)
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            given_up.append(goals)
            raise
        raise AssertionError

    monkeypatch.setattr(FakeNavigation, "wait", waits)

    async def ask() -> None:
        async with serving() as served, Client.connect(served.host, served.port) as robot:
            first = asyncio.create_task(robot.navigate_to(place="table 3"))
            second = asyncio.create_task(robot.navigate_to(place="hall", queue=True))
            await until(lambda: waited_for == [[1], [2]])
            second.cancel()
            with pytest.raises(asyncio.CancelledError):
                await second
            await until(lambda: given_up == [[2]])
            await robot.get_state()  # answered after whatever else was asked for
            assert ("cancel_navigation",) not in served.robot.calls
            assert not first.done()
            first.cancel()
            with pytest.raises(asyncio.CancelledError):
                await first

    run_virtual(ask())


def test_an_end_is_raised_as_its_own_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the robot's sentence; a refusal is no end, but a ``CallError``."""

    async def is_blocked(
        self: FakeNavigation, goals: list[int], progress: ProgressReporter, client: int
    ) -> GoalResult:
        return GoalResult(goal=goals[-1], end="blocked", reason="blocked for 60 s: something is in the way")

    monkeypatch.setattr(FakeNavigation, "wait", is_blocked)

    async def ask() -> None:
        async with serving() as served, Client.connect(served.host, served.port) as robot:
            with pytest.raises(GoalBlocked, match="something is in the way") as ended:
                await robot.navigate_to(place="table 3")
            assert (ended.value.end, ended.value.goal) == ("blocked", 1)
            with pytest.raises(CallError, match="less than or equal to 10000, got 10001") as refused:
                await robot.navigate_to(10001.0, 2.0)
            assert refused.value.kind == "invalid_params"

    run_virtual(ask())
