"""What comes while the daemon is still accepting a goal: the robot stands when the master is told so."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable

import pytest
from chefbot_vda5050 import acceptance
from chefbot_vda5050.chefbot import ChefBot
from chefbot_vda5050.problems import Problem
from vda5050_daemon import ACCEPTING_S, STEP_S, FakeDaemon
from vda5050_fakes import Fleet, error_types, is_idle
from vda5050_orders import line

from chefbotd.clock import run_virtual

pytestmark = pytest.mark.usefixtures("version")
Scenario = Callable[[Fleet, FakeDaemon], Awaitable[None]]


def with_daemon(scenario: Scenario) -> None:
    """Run a scenario with an agent at work, on such a daemon."""

    async def run() -> None:
        daemon = FakeDaemon()
        robot = ChefBot(daemon.connect)
        now = Fleet(robot)  # type: ignore[arg-type]
        tasks = [asyncio.create_task(work) for work in (daemon.run(), robot.run(), now.agent.run())]
        now.agent.set_online(True)
        try:
            await now.until(
                lambda state: bool(state.agv_position and state.agv_position.position_initialized)
            )
            await scenario(now, daemon)
        finally:
            for task in tasks:
                task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.gather(*tasks)
        assert now.problems == []

    run_virtual(run())


async def accepting(now: Fleet, daemon: FakeDaemon, goals: int) -> None:
    """Until the daemon has had so many goals, and accepts the last of them."""
    await now.order(line(0, 3))
    while len(daemon.calls) < goals:  # noqa: ASYNC110 - as a person looks
        await asyncio.sleep(0.01)
    await asyncio.sleep(ACCEPTING_S / 2)


def status(now: Fleet, number: str) -> str:
    """Of an action, as it was reported last."""
    found = [one.action_status for one in now.states()[-1].all_action_states if one.action_id == number]
    return str(*found)


@pytest.mark.parametrize("goals", [1, 2, 3])
def test_a_pause_while_a_goal_is_being_accepted_halts_the_robot(goals: int) -> None:
    """The first goal, or one that follows at a node without a stop: FINISHED says that the robot stands, and it does."""

    async def scenario(now: Fleet, daemon: FakeDaemon) -> None:
        await accepting(now, daemon, goals)
        await now.act("startPause", "p")
        state = await now.until(lambda state: status(now, "p") == "FINISHED")
        assert (state.paused, state.driving, daemon.is_moving(), list(state.errors)) == (
            True,
            False,
            False,
            [],
        )
        here_m = daemon.x_m
        await asyncio.sleep(20.0)
        assert daemon.x_m == here_m < 3.0
        await now.act("stopPause", "q")
        await now.until(lambda state: state.last_node_id == "n3" and is_idle(state))
        assert daemon.x_m == 3.0

    with_daemon(scenario)


@pytest.mark.parametrize("goals", [1, 2, 3])
def test_an_order_is_cancelled_while_a_goal_is_being_accepted(goals: int) -> None:
    """The robot does not go on to the goal before it."""

    async def scenario(now: Fleet, daemon: FakeDaemon) -> None:
        await accepting(now, daemon, goals)
        here_m = daemon.x_m
        await now.act("cancelOrder", "c")
        await now.until(lambda state: status(now, "c") == "FINISHED")
        assert not daemon.is_moving()
        await asyncio.sleep(20.0)
        assert daemon.x_m <= here_m + 2 * STEP_S * daemon.speed_m_s

    with_daemon(scenario)


def test_the_robot_does_not_go_on_to_a_goal_whose_successor_is_refused() -> None:
    """It stands and tries again."""

    async def scenario(now: Fleet, daemon: FakeDaemon) -> None:
        await accepting(now, daemon, 2)
        daemon.refusals.append("worker_unavailable")
        state = await now.until(lambda state: "driveError" in error_types(state))
        assert not daemon.is_moving()
        state = await now.until(lambda state: state.last_node_id == "n3" and is_idle(state))
        assert not state.errors

    with_daemon(scenario)


def test_a_mistake_of_ours_in_judging_one_order_costs_that_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is reported as refused, and the next order is driven."""
    judge = acceptance.judge

    def fail_once(*about: object) -> acceptance.Accepted | Problem:
        monkeypatch.setattr(acceptance, "judge", judge)
        raise AssertionError("a mistake")

    async def scenario(now: Fleet, daemon: FakeDaemon) -> None:
        monkeypatch.setattr(acceptance, "judge", fail_once)
        await now.order(line(0, 1))
        await now.until(lambda state: bool(error_types(state)))
        await now.order(line(0, 3))
        await now.until(lambda state: state.last_node_id == "n3" and is_idle(state))

    with_daemon(scenario)
