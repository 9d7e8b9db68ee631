"""The agent on the virtual clock, with a robot that drives 1 m/s: what a master sees of an order."""

import asyncio
import re
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from chefbot_vda5050.agent import RETRY_S, STATE_EVERY_S
from chefbot_vda5050.freshness import Freshness, judge_age
from chefbot_vda5050.messages import EStop, Factsheet, Level, OperatingMode, decode, encode
from chefbot_vda5050.robot import DriveFailed
from chefbot_vda5050.topics import Kind, timestamp_of
from chefbot_vda5050.vehicle import Facts
from msgspec.structs import replace
from vda5050_fakes import EPOCH_S, FakeRobot, Fleet, error_types, fleet, is_idle, status
from vda5050_orders import HEADER, action, line

from chefbotd.clock import run_virtual

pytestmark = pytest.mark.usefixtures("version")


def with_fleet(scenario: Callable[[Fleet], Awaitable[None]], **options: Any) -> None:
    """Run a scenario with an agent at work."""

    async def run() -> None:
        async with fleet(FakeRobot(), **options) as now:
            await scenario(now)

    run_virtual(run())


def test_an_order_of_three_nodes_is_driven_and_each_node_is_reported() -> None:
    """The robot goes over the middle ones without a stop, and every state is valid."""

    async def scenario(now: Fleet) -> None:
        await now.order(line(0, 3))
        state = await now.until(lambda state: state.last_node_id == "n3" and is_idle(state))
        assert (state.order_id, state.last_node_sequence_id) == ("o1", 6)
        assert now.robot.driven == [(3.0, 0.0)]
        reached = list(dict.fromkeys(state.last_node_id for state in now.states()))
        assert reached == ["", "n0", "n1", "n2", "n3"]
        assert all(state.last_node_id != "n1" or state.driving for state in now.states())

    with_fleet(scenario)


def test_each_edge_is_driven_no_faster_than_it_allows() -> None:
    """0.25 m/s until the robot is within 0.3 m of the node, which it passes; then its own 1 m/s: 2.8 s and 1.3 s."""

    async def scenario(now: Fleet) -> None:
        order = line(0, 2)
        slow = replace(order.edges[0], max_speed=0.25)
        began_s = now.now_s()
        await now.order(replace(order, edges=(slow, order.edges[1]), nodes=order.nodes))
        speeds: dict[str, set[float]] = {}
        while now.states()[-1].last_node_id != "n2":
            await asyncio.sleep(0.05)
            speeds.setdefault(now.agent.vehicle.last_node_id, set()).add(now.robot.facts.linear_m_s)
        assert speeds["n0"] - {0.0} == {0.25}
        assert max(speeds["n1"]) == 1.0
        assert now.now_s() - began_s == pytest.approx(0.7 / 0.25 + 1.3, abs=0.4)

    with_fleet(scenario)


def test_the_robot_waits_at_the_end_of_the_base_and_drives_on_with_the_update() -> None:
    """It never comes beyond a node that is not released."""

    async def scenario(now: Fleet) -> None:
        await now.order(line(0, 3, base=1))
        await now.until(lambda state: state.last_node_id == "n1" and not state.driving)
        await asyncio.sleep(5.0)
        assert now.robot.facts.x_m == pytest.approx(1.0)
        await now.order(line(1, 3, update=1))
        await now.until(lambda state: state.last_node_id == "n3" and is_idle(state))
        assert now.robot.driven == [(1.0, 0.0), (3.0, 0.0)]

    with_fleet(scenario)


def test_food_is_asked_to_be_loaded_and_taken() -> None:
    """Pick and drop are questions to people; the load is in the state between them."""

    async def scenario(now: Fleet) -> None:
        pick = action("pick", "p", loadType="soup", stationName="the kitchen")
        await now.order(line(0, 1, actions={0: (pick,), 1: (action("drop", "d", stationName="table 2"),)}))
        await now.until(lambda state: status(state, "p") == "RUNNING")
        assert now.robot.asked == ["Please load soup on me at the kitchen."]
        now.robot.answers.put_nowait(None)  # nobody was there within an hour
        now.robot.answers.put_nowait("Loaded")
        state = await now.until(lambda state: state.last_node_id == "n1")
        assert [load.load_type for load in state.loads or ()] == ["soup"]
        now.robot.answers.put_nowait("Taken")
        state = await now.until(is_idle)
        assert now.robot.asked[2:] == ["Please take the load from me at table 2."]
        assert (state.loads, [one.action_status for one in state.action_states]) == ((), ["FINISHED"] * 2)

    with_fleet(scenario)


def test_what_people_cannot_do_is_an_action_that_failed() -> None:
    """With its error; the order goes on."""

    async def scenario(now: Fleet) -> None:
        await now.order(line(0, 1, actions={0: (action(),)}))
        now.robot.answers.put_nowait("It does not work")
        state = await now.until(lambda state: state.last_node_id == "n1" and is_idle(state))
        assert (state.action_states[0].action_status, error_types(state)) == ("FAILED", ["actionError"])

    with_fleet(scenario)


def test_waiting_speaking_and_a_trigger_are_actions_too() -> None:
    """A wait of 2 s takes 2 s."""

    async def scenario(now: Fleet) -> None:
        todo = (
            action("say", "s", "NONE", text="Good evening"),
            action("wait", "w", "HARD", duration=2),
            action("waitForTrigger", "t", "HARD", triggerType="the cook"),
        )
        began_s = now.now_s()
        await now.order(line(0, 0, actions={0: todo}))
        await now.until(lambda state: status(state, "t") == "RUNNING")
        assert now.now_s() - began_s == pytest.approx(2.0, abs=0.2)
        assert (now.robot.said, now.robot.asked) == (
            ["Good evening"],
            ["I wait for the cook. Shall I go on?"],
        )
        now.robot.answers.put_nowait("Go on")
        await now.until(is_idle)

    with_fleet(scenario)


def test_a_cancelled_order_stops_the_robot_on_its_way() -> None:
    """The state says so when it stands; the question that was open is given up."""

    async def scenario(now: Fleet) -> None:
        await now.order(line(0, 3, actions={3: (action(),)}))
        await now.until(lambda state: state.last_node_id == "n1")
        await now.act("cancelOrder", "c")
        state = await now.until(is_idle)
        assert {one.action_id: str(one.action_status) for one in state.all_action_states} == {
            "a1": "FAILED",
            "c": "FINISHED",
        }
        assert not state.driving
        assert now.robot.driven == []
        here_m = now.robot.facts.x_m
        await asyncio.sleep(10.0)
        assert now.robot.facts.x_m == here_m < 2.0
        await now.order(line(1, 2, order_id="o2", allowed_deviation_xy=1.5))
        await now.until(lambda state: state.order_id == "o2" and is_idle(state))

    with_fleet(scenario)


def test_a_pause_halts_the_robot_and_its_end_lets_it_go_on() -> None:
    """StartPause is finished when the robot stands."""

    async def scenario(now: Fleet) -> None:
        await now.order(line(0, 2))
        await asyncio.sleep(0.55)
        await now.act("startPause", "p")
        state = await now.until(lambda state: status(state, "p") == "FINISHED")
        assert (state.paused, state.driving) == (True, False)
        await asyncio.sleep(20.0)
        assert now.robot.facts.x_m < 1.0
        await now.act("stopPause", "q")
        state = await now.until(lambda state: state.last_node_id == "n2" and is_idle(state))
        assert state.paused is False

    with_fleet(scenario)


def test_who_stops_the_robot_at_its_page_pauses_it_and_lets_it_go_on() -> None:
    """The master sees the pause; the button on the page ends it."""

    async def scenario(now: Fleet) -> None:
        now.robot.fails.append(DriveFailed("stopped on the page", "press", by_people=True))
        await now.order(line(0, 1))
        state = await now.until(lambda state: bool(state.paused))
        assert error_types(state) == ["driveError"]
        await asyncio.sleep(10 * RETRY_S)
        assert now.robot.driven == []
        now.robot.go_on()
        await now.until(lambda state: state.last_node_id == "n1" and is_idle(state) and not state.errors)

    with_fleet(scenario)


def test_an_emergency_stop_between_two_drives_pauses_the_order_too() -> None:
    """Pressed and armed again while the robot waits at a node, it drives on when somebody lets it."""

    async def scenario(now: Fleet) -> None:
        await now.order(line(0, 1, actions={0: (action("wait", "w", "HARD", duration=5),)}))
        await now.until(lambda state: status(state, "w") == "RUNNING")
        now.robot.set(armed=False, e_stop=EStop.MANUAL)
        now.robot.set(armed=True, e_stop=EStop.NONE)
        await now.until(lambda state: status(state, "w") == "FINISHED")
        await asyncio.sleep(10 * RETRY_S)
        assert now.states()[-1].paused
        assert now.robot.driven == []
        now.robot.go_on()
        await now.until(lambda state: state.last_node_id == "n1" and is_idle(state) and not state.paused)

    with_fleet(scenario)


@pytest.mark.parametrize("mode", [OperatingMode.MANUAL, OperatingMode.SERVICE])
def test_a_robot_that_is_taken_by_hand_deletes_its_order(mode: OperatingMode) -> None:
    """6.10.6: what was to be done is FAILED; afterwards the robot takes a new order, and no update of the old one."""

    async def scenario(now: Fleet) -> None:
        await now.order(line(0, 3, base=2, actions={2: (action(),)}))
        await now.until(lambda state: state.last_node_id == "n1")
        now.robot.set(mode=mode)
        state = await now.until(lambda state: not state.node_states and is_idle(state))
        assert (state.order_id, status(state, "a1"), state.operating_mode) == ("o1", "FAILED", mode)
        assert state.last_node_id == ("n1" if mode is OperatingMode.MANUAL else "")
        await now.order(line(2, 3, update=1))
        await now.until(lambda state: error_types(state) == ["orderUpdateError"])
        now.robot.set(mode=OperatingMode.AUTOMATIC)
        await now.order(line(1, 2, order_id="o2", allowed_deviation_xy=1.5))
        await now.until(lambda state: state.order_id == "o2" and state.last_node_id == "n2")

    with_fleet(scenario)


def test_a_robot_that_is_driven_by_hand_for_now_keeps_its_order() -> None:
    """INTERVENED of 3.0: orders and updates are taken, and driven afterwards."""

    async def scenario(now: Fleet) -> None:
        await now.order(line(0, 3, base=1))
        await now.until(lambda state: state.last_node_id == "n0")
        now.robot.set(mode=OperatingMode.INTERVENED)
        await now.order(line(1, 3, update=1))
        state = await now.until(lambda state: state.last_node_id == "n3" and is_idle(state))
        expected = OperatingMode.INTERVENED if HEADER["version"][0] == "3" else OperatingMode.MANUAL
        assert (state.operating_mode, state.errors) == (expected, ())

    with_fleet(scenario)


def test_what_the_robot_waits_for_can_come_from_the_fleet() -> None:
    """``trigger`` ends the wait as people do at the page; without one that waits it fails."""

    async def scenario(now: Fleet) -> None:
        await now.act("trigger", "t0")
        await now.until(lambda state: status(state, "t0") == "FAILED")
        wait = action("waitForTrigger", "w", "HARD", triggerType=["FLEET_CONTROL"])
        await now.order(line(0, 1, actions={0: (wait,)}))
        await now.until(lambda state: status(state, "w") == "RUNNING")
        assert now.robot.asked == ["I wait for my fleet. Shall I go on?"]
        await now.act("trigger", "t1")
        state = await now.until(lambda state: state.last_node_id == "n1" and is_idle(state))
        assert (status(state, "w"), status(state, "t1")) == ("FINISHED", "FINISHED")

    with_fleet(scenario)


def test_a_way_that_is_blocked_is_tried_again() -> None:
    """With an error and a hint until it is free."""

    async def scenario(now: Fleet) -> None:
        now.robot.fails += [
            DriveFailed("somebody stands there", "Make way."),
            DriveFailed("still", "Make way."),
        ]
        await now.order(line(0, 1))
        state = await now.until(lambda state: bool(state.errors))
        assert (error_types(state), state.errors[0].error_hint) == (["driveError"], "Make way.")
        await now.until(lambda state: state.last_node_id == "n1" and not state.errors)

    with_fleet(scenario)


def test_6_1_4_8_a_node_without_a_way_is_refused_before_the_robot_moves() -> None:
    """NO_ROUTE_TO_TARGET in version 3.0, a noRouteError in 2.1."""

    async def scenario(now: Fleet) -> None:
        now.robot.closed.add((3.0, 0.0))
        await now.order(line(0, 3, base=1))
        state = await now.until(lambda state: bool(state.errors))
        assert (error_types(state), state.order_id) == (["noRouteError"], "")
        await asyncio.sleep(5.0)
        assert now.robot.facts.x_m == 0.0

    with_fleet(scenario)


@pytest.mark.parametrize("data", [b"{", b"[]", b"{}"])
def test_a_malformed_order_is_reported(data: bytes) -> None:
    """6.6.4.1; it stays until an order is accepted."""

    async def scenario(now: Fleet) -> None:
        now.agent.receive(Kind.ORDER, data)
        state = await now.until(lambda state: bool(state.errors))
        assert error_types(state) == ["validationError"]
        await now.order(line(0, 1))
        await now.until(lambda state: state.order_id == "o1" and not state.errors)

    with_fleet(scenario)


@pytest.mark.parametrize(
    "changes",
    [{"version": "4.0.0"}, {"serial_number": "r2"}, {"manufacturer": "other"}],
)
def test_an_order_of_another_version_or_robot_is_refused(changes: dict[str, Any]) -> None:
    """A topic is easily mistyped."""

    async def scenario(now: Fleet) -> None:
        await now.order(line(0, 1), **changes)
        state = await now.until(lambda state: bool(state.errors))
        assert (error_types(state), state.order_id) == (["validationError"], "")

    with_fleet(scenario)


@pytest.mark.parametrize("age_s", [11.0, 3600.0, -11.0])
def test_an_order_that_is_late_is_never_driven(age_s: float) -> None:
    """Older than 10 s, or from a clock that is so far ahead that nothing can be told of its age."""

    async def scenario(now: Fleet) -> None:
        await now.order(line(0, 1), timestamp=timestamp_of(now.now_s() - age_s))
        state = await now.until(lambda state: bool(state.errors))
        assert (error_types(state), state.order_id) == (["orderError"], "")
        assert "too late" in (state.errors[0].error_description or "")
        await asyncio.sleep(5.0)
        assert now.robot.facts.x_m == 0.0

    with_fleet(scenario)


def test_an_order_that_the_broker_has_kept_is_never_driven() -> None:
    """Retained: its age is not known."""

    async def scenario(now: Fleet) -> None:
        fresh = replace(line(0, 1), timestamp=timestamp_of(now.now_s()))
        now.agent.receive(Kind.ORDER, encode(fresh), retained=True)
        state = await now.until(lambda state: bool(state.errors))
        assert state.order_id == ""

    with_fleet(scenario)


@pytest.mark.parametrize(
    ("header_id", "stamp_s", "late"),
    [(5, 1.0, False), (3, 1.0, False), (5, 0.5, False), (4, -0.5, True), (3, -0.5, True)],
)
def test_messages_in_another_sequence_are_late(header_id: int, stamp_s: float, late: bool) -> None:
    """After header 4 of time 0: lower and earlier is late; a master that begins anew counts from 0, but later."""
    header = replace(line(0, 0), header_id=header_id, timestamp=timestamp_of(EPOCH_S + stamp_s))
    after, why = judge_age(Freshness(4, EPOCH_S), header, EPOCH_S + 1.0, 10.0)
    assert bool(why) is late
    assert after == (Freshness(4, EPOCH_S) if late else Freshness(header_id, EPOCH_S + stamp_s))


def test_the_state_comes_at_least_every_30_s_and_with_every_change() -> None:
    """Standing still, four in 100 s; a change of the robot is reported at once."""

    async def scenario(now: Fleet) -> None:
        await asyncio.sleep(1.0)
        before = len(now.states())
        await asyncio.sleep(100.0)
        assert len(now.states()) - before == int(100.0 / STATE_EVERY_S)
        began_s = now.now_s()
        now.robot.set(armed=False, missing="a person pressed it", fault="wheel_stalled")
        state = await now.until(lambda state: bool(state.errors))
        assert now.now_s() - began_s < 0.2
        assert error_types(state) == ["disarmed", "robotFault"]
        assert {one.error_level for one in state.errors} == {Level.FATAL}

    with_fleet(scenario)


def test_a_robot_whose_daemon_is_gone_says_so_and_drives_on_when_it_is_back() -> None:
    """The order is kept."""

    async def scenario(now: Fleet) -> None:
        now.robot.fails.append(DriveFailed("the connection is lost"))
        await now.order(line(0, 1))
        await now.until(lambda state: state.order_id == "o1")
        known = now.robot.facts
        now.robot.set(**{name: getattr(Facts(missing="gone"), name) for name in ("connected", "missing")})
        state = await now.until(lambda state: "robotUnreachable" in error_types(state))
        assert state.order_id == "o1"
        now.robot.facts = known
        await now.until(lambda state: state.last_node_id == "n1" and is_idle(state))

    with_fleet(scenario)


def test_without_a_broker_the_robot_drives_to_its_last_released_node_and_says_so() -> None:
    """6.2: it keeps its order, and waits there; back again, it reports and takes the update."""

    async def scenario(now: Fleet) -> None:
        await now.order(line(0, 4, base=2))
        await asyncio.sleep(0.5)
        now.agent.set_online(False)
        await asyncio.sleep(30.0)
        assert now.robot.facts.x_m == pytest.approx(2.0)
        assert now.robot.said == [
            "I have lost my fleet. I drive to the end of my way, and wait there.",
            "I wait here until my fleet is back.",
        ]
        now.agent.set_online(True)
        await now.order(line(2, 4, update=1))
        await now.until(lambda state: state.last_node_id == "n4" and is_idle(state))

    with_fleet(scenario)


def test_without_a_broker_the_robot_at_the_end_of_its_base_says_that_it_waits() -> None:
    """It was there already when the broker was lost; an idle robot says nothing."""

    async def scenario(now: Fleet) -> None:
        now.agent.set_online(False)
        await asyncio.sleep(1.0)
        assert now.robot.said == []
        now.agent.set_online(True)
        await now.order(line(0, 2, base=1))
        await now.until(lambda state: state.last_node_id == "n1" and not state.driving)
        now.agent.set_online(False)
        await asyncio.sleep(1.0)
        assert now.robot.said == ["I wait here until my fleet is back."]

    with_fleet(scenario)


@pytest.mark.parametrize("field", ["orderId", "nodeId", "actionType"])
def test_what_is_written_into_an_order_does_not_swell_the_state(field: str) -> None:
    """A megabyte of text is refused, and the state stays below 10 kB."""

    async def scenario(now: Fleet) -> None:
        order = replace(line(0, 1, actions={1: (action(),)}), timestamp=timestamp_of(now.now_s()))
        data = re.sub(
            rf'"{field}":"[^"]*"'.encode(), f'"{field}":"{"x" * 1_000_000}"'.encode(), encode(order)
        )
        now.agent.receive(Kind.ORDER, data)
        await now.until(lambda state: error_types(state) == ["validationError"])
        assert max(len(sent) for kind, sent in now.sent if kind is Kind.STATE) < 10_000

    with_fleet(scenario)


def test_instant_actions_answer_with_what_was_asked_for() -> None:
    """State and factsheet at once; initPosition sets the pose and the last node."""

    async def scenario(now: Fleet) -> None:
        await asyncio.sleep(1.0)
        sent = len(now.sent)
        await now.act("factsheetRequest", "f")
        await now.act("stateRequest", "s")
        await asyncio.sleep(0.2)
        kinds = [kind for kind, _ in now.sent[sent:] if kind is not Kind.VISUALIZATION]
        assert sorted(kinds) == [Kind.FACTSHEET, Kind.STATE]
        await now.act("initPosition", "i", x=2, y=0.5, theta=1.0, mapId="flat", lastNodeId="n2")
        state = await now.until(lambda state: state.last_node_id == "n2")
        assert state.agv_position is not None
        assert (state.agv_position.x, state.agv_position.y, state.agv_position.theta) == (2.0, 0.5, 1.0)
        await now.act("initPosition", "j", x=2, y=0.5, theta=1.0, mapId="roof")
        await now.until(lambda state: status(state, "j") == "FAILED")

    with_fleet(scenario)


def test_the_factsheet_lists_every_action_that_the_robot_takes() -> None:
    """With its scopes; it is published when the robot comes online."""

    async def scenario(now: Fleet) -> None:
        await asyncio.sleep(0.1)
        (data,) = [data for kind, data in now.sent if kind is Kind.FACTSHEET]
        sheet = decode(data, Factsheet)
        scopes = {one["actionType"]: one["actionScopes"] for one in sheet.protocol_features["agvActions"]}
        assert (scopes["pick"], scopes["say"], scopes["cancelOrder"]) == (
            ["NODE"],
            ["INSTANT", "NODE"],
            ["INSTANT"],
        )

    with_fleet(scenario)


def test_more_messages_than_can_wait_are_dropped_and_the_robot_lives() -> None:
    """A flood of a thousand of each kind: those that fit are answered, and an order after it is driven."""

    async def scenario(now: Fleet) -> None:
        first = encode(replace(line(0, 1, order_id="o0"), timestamp=timestamp_of(now.now_s())))
        for _ in range(1000):
            now.agent.receive(Kind.INSTANT_ACTIONS, b"{")
            now.agent.receive(Kind.ORDER, first)
        await asyncio.sleep(10.0)
        await now.order(line(1, 2))
        await now.until(lambda state: state.last_node_id == "n2" and is_idle(state))

    with_fleet(scenario)


def test_visualization_comes_each_second_while_there_is_a_map() -> None:
    """And none without."""

    async def scenario(now: Fleet) -> None:
        def count() -> int:
            return sum(kind is Kind.VISUALIZATION for kind, _ in now.sent)

        before = count()
        await asyncio.sleep(10.0)
        assert 9 <= count() - before <= 11
        now.robot.set(map_id="")
        await asyncio.sleep(1.5)
        before = count()
        await asyncio.sleep(10.0)
        assert count() == before

    with_fleet(scenario)


def test_the_header_of_this_file_is_the_robots() -> None:
    """Else the tests of foreign headers would prove nothing."""
    assert (HEADER["manufacturer"], HEADER["serial_number"]) == ("chefbot", "r1")
