"""What stops the robot waits for nothing and is never too late; an order is judged by what is true when it begins."""

import asyncio
from typing import Any

import pytest
from chefbot_vda5050.messages import InstantActions, OperatingMode, State, encode
from chefbot_vda5050.robot import DriveFailed
from chefbot_vda5050.topics import Kind, timestamp_of
from msgspec.structs import replace
from test_vda5050_agent import with_fleet
from vda5050_fakes import Fleet, error_types, is_idle, status
from vda5050_orders import HEADER, action, line

pytestmark = pytest.mark.usefixtures("version")


async def driving(now: Fleet) -> None:
    """Until the robot drives along an order of three metres; its planner takes 1 s for a node from then on."""
    await now.order(line(0, 3, base=1))
    await now.until(lambda state: state.driving)
    now.robot.planning_s = 1.0


def test_a_pause_does_not_wait_until_the_ways_to_nodes_are_known() -> None:
    """An update of six nodes is being judged for 6 s; the robot stands within half a second."""

    async def scenario(now: Fleet) -> None:
        await driving(now)
        await now.order(line(1, 7, update=1))
        await now.act("startPause", "p")
        began_s = now.now_s()
        state = await now.until(lambda state: status(state, "p") == "FINISHED")
        assert now.now_s() - began_s < 0.5
        assert (state.paused, state.driving, state.order_update_id) == (True, False, 0)
        await now.until(lambda state: state.order_update_id == 1)
        await asyncio.sleep(10.0)
        assert now.robot.driven == []
        await now.act("stopPause", "q")
        await now.until(lambda state: state.last_node_id == "n7" and is_idle(state))

    with_fleet(scenario)


@pytest.mark.parametrize("named", [{}, {"orderId": "o1"}])
def test_an_order_that_is_cancelled_while_it_is_judged_never_begins(named: dict[str, str]) -> None:
    """Nor do those that wait behind it; the master is told."""

    async def scenario(now: Fleet) -> None:
        now.robot.planning_s = 1.0
        await now.order(line(0, 3))
        await now.order(line(0, 3, update=1))
        await asyncio.sleep(0.5)
        await now.act("cancelOrder", "c", **named)
        state = await now.until(lambda state: "orderUpdateError" in error_types(state))
        assert (state.order_id, status(state, "c")) == ("", "FAILED")
        await asyncio.sleep(20.0)
        assert (now.robot.facts.x_m, now.states()[-1].order_id) == (0.0, "")

    with_fleet(scenario)


def test_the_cancellation_of_another_order_leaves_the_one_that_is_judged() -> None:
    """It names the one that it means."""

    async def scenario(now: Fleet) -> None:
        now.robot.planning_s = 1.0
        await now.order(line(0, 1))
        await now.act("cancelOrder", "c", orderId="o0")
        await now.until(lambda state: status(state, "c") == "FAILED")
        await now.until(lambda state: state.last_node_id == "n1" and is_idle(state))

    with_fleet(scenario)


@pytest.mark.parametrize("kind", ["startPause", "cancelOrder"])
@pytest.mark.parametrize("changes", [{"age_s": 11.0}, {"age_s": -11.0}, {"age_s": 86400.0}, {"header_id": 0}])
def test_a_stop_counts_whatever_its_age(kind: str, changes: dict[str, Any]) -> None:
    """Old, from a clock that is ahead, or after a later message: the robot stands."""

    async def scenario(now: Fleet) -> None:
        await now.act("stateRequest", "s")
        await driving(now)
        header = {"header_id": 7, "timestamp": timestamp_of(now.now_s() - changes.get("age_s", 3.0))}
        await now.send(
            Kind.INSTANT_ACTIONS,
            InstantActions(**HEADER, actions=(action(kind, "x", "NONE"),)),
            **(header | {key: value for key, value in changes.items() if key == "header_id"}),
        )
        state = await now.until(lambda state: status(state, "x") == "FINISHED")
        assert (state.driving, state.errors) == (False, ())
        await asyncio.sleep(10.0)
        assert now.robot.facts.x_m < 1.0

    with_fleet(scenario)


def test_of_a_late_message_only_what_stops_the_robot_is_done() -> None:
    """The rest is refused, and the end of the pause too."""

    async def scenario(now: Fleet) -> None:
        await driving(now)
        late = timestamp_of(now.now_s() - 60.0)
        todo = (action("say", "s", "NONE", text="hello"), action("startPause", "p", "NONE"))
        await now.send(Kind.INSTANT_ACTIONS, InstantActions(**HEADER, actions=todo), timestamp=late)
        state = await now.until(lambda state: status(state, "p") == "FINISHED")
        assert (error_types(state), status(state, "s"), now.robot.said) == (["orderError"], "", [])
        resume = (action("stopPause", "q", "NONE"),)
        await now.send(Kind.INSTANT_ACTIONS, InstantActions(**HEADER, actions=resume), timestamp=late)
        await asyncio.sleep(10.0)
        assert (now.states()[-1].paused, now.robot.driven) == (True, [])

    with_fleet(scenario)


def test_of_too_many_instant_actions_only_what_stops_the_robot_is_done() -> None:
    """A message with a thousand, and the pause at its end."""

    async def scenario(now: Fleet) -> None:
        await driving(now)
        says = (action("say", f"s{number}", "NONE", text="Hello") for number in range(1000))
        await now.instant(*says, action("startPause", "p", "NONE"))
        state = await now.until(lambda state: status(state, "p") == "FINISHED")
        assert (error_types(state), state.driving, now.robot.said) == (["validationError"], False, [])

    with_fleet(scenario)


def test_a_stop_that_the_broker_has_kept_is_refused() -> None:
    """Else each new connection would cancel the order anew."""

    async def scenario(now: Fleet) -> None:
        await driving(now)
        actions = (action("cancelOrder", "c", "NONE"),)
        kept = replace(InstantActions(**HEADER, actions=actions), timestamp=timestamp_of(now.now_s()))
        now.agent.receive(Kind.INSTANT_ACTIONS, encode(kept), retained=True)
        state = await now.until(lambda state: bool(state.errors))
        assert (error_types(state), status(state, "c")) == (["orderError"], "")
        await now.until(lambda state: state.last_node_id == "n1")

    with_fleet(scenario)


def test_a_stop_counts_where_more_orders_came_than_can_wait() -> None:
    """A thousand updates wait while the first of them is judged."""

    async def scenario(now: Fleet) -> None:
        await driving(now)
        for update in range(1, 1001):
            await now.order(line(1, 3, update=update))
        await now.act("startPause", "p")
        await now.until(lambda state: status(state, "p") == "FINISHED" and not state.driving)
        assert now.robot.facts.x_m < 1.0

    with_fleet(scenario)


def test_an_order_that_becomes_too_late_while_it_is_judged_is_refused() -> None:
    """Four ways of 3 s each are 12 s; it may be 10 s old."""

    async def scenario(now: Fleet) -> None:
        now.robot.planning_s = 3.0
        await now.order(line(0, 4))
        state = await now.until(lambda state: bool(state.errors))
        assert (error_types(state), state.order_id) == (["orderError"], "")
        assert "too late" in (state.errors[0].error_description or "")
        await asyncio.sleep(10.0)
        assert now.robot.facts.x_m == 0.0

    with_fleet(scenario)


def test_an_order_is_refused_when_somebody_takes_the_robot_while_it_is_judged() -> None:
    """Driven by hand, it takes no order, also where the order came before."""

    async def scenario(now: Fleet) -> None:
        now.robot.planning_s = 1.0
        await now.order(line(0, 2))
        await asyncio.sleep(1.5)
        now.robot.set(mode=OperatingMode.MANUAL)

        def is_refused(state: State) -> bool:
            return error_types(state) == ["orderError"] and state.order_id == ""

        await now.until(is_refused)
        await asyncio.sleep(10.0)
        assert now.robot.facts.x_m == 0.0

    with_fleet(scenario)


def stop_and_arm(now: Fleet, *, is_heard: bool) -> None:
    """Somebody stops the robot, and arms it at once; not ``is_heard``: only its number tells of that."""
    if is_heard:
        now.robot.set(armed=False)
        now.robot.set(armed=True)
    else:
        now.robot.set(stop_number=now.robot.facts.stop_number + 1)


async def waits_for_a_person(now: Fleet) -> None:
    """The order is there and paused for 30 s, the robot stands, and "Go on" has it drive to the end."""
    x_m = now.robot.facts.x_m
    state = await now.until(lambda state: state.order_id == "o1" and state.paused)
    assert error_types(state) == ["driveError"]
    await asyncio.sleep(30.0)
    assert now.robot.facts.x_m == x_m
    now.robot.go_on()
    await now.until(lambda state: state.last_node_id == "n3" and is_idle(state))


@pytest.mark.parametrize("is_heard", [True, False])
@pytest.mark.parametrize("at_s", [0.25, 1.5])
def test_an_order_that_is_judged_while_somebody_stops_the_robot_waits_for_a_person(
    is_heard: bool, at_s: float
) -> None:
    """An e-stop and an arm while the ways to its nodes are planned: it is taken, and begins nothing by itself."""

    async def scenario(now: Fleet) -> None:
        now.robot.set(stop_number=1048576)
        now.robot.planning_s = 1.0
        await now.order(line(0, 3))
        await asyncio.sleep(at_s)
        stop_and_arm(now, is_heard=is_heard)
        await waits_for_a_person(now)

    with_fleet(scenario)


def test_an_order_that_came_while_the_robot_was_stopped_waits_for_a_person() -> None:
    """Somebody arms the robot while the order is judged."""

    async def scenario(now: Fleet) -> None:
        now.robot.planning_s = 1.0
        now.robot.set(armed=False)
        await now.order(line(0, 3))
        await asyncio.sleep(0.5)
        now.robot.set(armed=True)
        await waits_for_a_person(now)

    with_fleet(scenario)


def test_an_order_under_way_waits_when_the_robot_was_stopped_while_its_daemon_was_not_reached() -> None:
    """Back again it is armed, and only its number is another one: somebody stopped it, or its daemon began anew."""

    async def scenario(now: Fleet) -> None:
        now.robot.set(stop_number=1048576)
        now.robot.fails = [DriveFailed("the connection was lost")]
        await now.order(line(0, 3))
        await now.until(lambda state: error_types(state) == ["driveError"])
        now.robot.set(connected=False)
        await asyncio.sleep(1.0)
        now.robot.set(connected=True, stop_number=1048578)
        await waits_for_a_person(now)

    with_fleet(scenario)


@pytest.mark.slow
@pytest.mark.parametrize("is_away", [False, True])
@pytest.mark.parametrize("is_heard", [True, False])
def test_at_each_of_100_moments_a_stop_leaves_an_order_waiting_for_a_person(
    is_heard: bool, is_away: bool
) -> None:
    """While it is judged for 3 s, or on its way with the daemon out of reach: 100 of 100 begin nothing by themselves."""

    async def scenario(now: Fleet) -> None:
        now.robot.set(stop_number=1048576)
        for number in range(100):
            now.robot.planning_s = 0.0 if is_away else 1.0
            now.robot.set(x_m=0.0)
            await now.order(line(0, 3, order_id=f"o{number}"))
            await asyncio.sleep(0.029 * number + 0.01)
            if is_away:
                now.robot.fails = [DriveFailed("the connection was lost")]
                await now.robot.stop()
                now.robot.set(connected=False)
                now.robot.set(connected=True, stop_number=now.robot.facts.stop_number + 1)
            else:
                stop_and_arm(now, is_heard=is_heard)
            name = f"o{number}"
            await now.until(lambda state, name=name: state.order_id == name and state.paused)
            x_m = now.robot.facts.x_m
            await asyncio.sleep(5.0)
            assert now.robot.facts.x_m == x_m
            await now.act("cancelOrder", f"c{number}")
            await now.until(is_idle)
            await now.act("stopPause", f"p{number}")
            await asyncio.sleep(1.0)

    with_fleet(scenario)
