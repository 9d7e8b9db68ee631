"""The steps of an order, on values: nodes at x = 0, 1, 2, ... metres; the robot stands at 0."""

import itertools

import pytest
from chefbot_vda5050 import actions, order
from chefbot_vda5050.actions import Event, Tracked
from chefbot_vda5050.messages import ActionStatus, Load, encode
from chefbot_vda5050.problems import Reason
from chefbot_vda5050.state import state
from chefbot_vda5050.topics import Kind
from chefbot_vda5050.vehicle import (
    NEXT,
    Cancel,
    DriveTo,
    OrderEvent,
    Pause,
    Phase,
    Resume,
    Send,
    Start,
    Stop,
    Vehicle,
)
from msgspec.structs import replace
from vda5050_fakes import strict_problems
from vda5050_orders import AT_START, HEADER, LIMITS, action, instant, line, node, reached, receive, statuses


def begun(*indices: int, **order_fields: object) -> Vehicle:
    """The vehicle with an order from 0 to 3, after it has reached these nodes."""
    vehicle, _ = receive(Vehicle(), line(0, 3, **order_fields))  # type: ignore[arg-type]
    return reached(vehicle, *indices)


def test_the_first_node_counts_as_reached_and_the_second_is_driven_to() -> None:
    """6.6.1: the robot stands on the first node."""
    vehicle, effects = receive(Vehicle(), line(0, 2))
    assert (vehicle.last_node_id, vehicle.last_node_sequence_id, vehicle.driving_to) == ("n0", 0, 2)
    assert effects == (DriveTo(node(1)),)


def test_a_first_node_with_another_heading_is_turned_to() -> None:
    """The robot looks along x, and the node wants the opposite."""
    vehicle, effects = receive(Vehicle(), line(0, 1, theta=3.1))
    assert (vehicle.last_node_id, vehicle.driving_to) == ("", 0)
    assert effects == (DriveTo(node(0, theta=3.1)),)


def test_an_order_is_finished_after_its_last_node() -> None:
    """Nodes and edges go as they are reached; the order's id stays."""
    vehicle = begun(1, 2)
    assert [one.edge_id for one in vehicle.edges] == ["e2"]
    vehicle = reached(vehicle, 3)
    assert (vehicle.phase, vehicle.nodes, vehicle.edges) == (Phase.FINISHED, (), ())
    assert (vehicle.order_id, vehicle.last_node_id, vehicle.last_node_sequence_id) == ("o1", "n3", 6)


def test_a_horizon_is_not_driven() -> None:
    """At the end of the base the robot waits, and asks for more before."""
    vehicle = begun(base=2)
    assert not vehicle.needs_base()
    vehicle = reached(vehicle, 1)
    assert vehicle.needs_base()
    vehicle, effects = order.node_reached(vehicle, 4)
    assert (vehicle.phase, vehicle.driving_to, effects) == (Phase.ACTIVE, None, ())
    assert [one.node_id for one in vehicle.nodes] == ["n3"]


def test_an_update_takes_the_place_of_the_horizon_and_the_robot_drives_on() -> None:
    """6.6.2, figure 6: the first node of the update is the last of the base."""
    vehicle = begun(1, 2, base=2)
    vehicle, effects = receive(vehicle, line(2, 5, base=4, update=1))
    assert effects == (DriveTo(node(3)),)
    assert [(one.node_id, one.released) for one in vehicle.nodes] == [
        ("n3", True),
        ("n4", True),
        ("n5", False),
    ]
    assert [one.edge_id for one in vehicle.edges] == ["e2", "e3", "e4"]
    assert vehicle.order_update_id == 1


def test_an_update_on_the_way_changes_nothing_of_the_drive() -> None:
    """The node that is driven to stays; those behind it are appended."""
    vehicle = begun(base=2)
    vehicle, effects = receive(vehicle, line(2, 4, update=1))
    assert effects == ()
    assert vehicle.driving_to == 2
    assert [one.node_id for one in vehicle.nodes] == ["n1", "n2", "n3", "n4"]


def test_an_update_continues_an_order_that_is_finished() -> None:
    """6.6.2, step 8."""
    vehicle, effects = receive(begun(1, 2, 3), line(3, 4, update=1))
    assert (vehicle.phase, effects) == (Phase.ACTIVE, (DriveTo(node(4)),))


def test_an_update_may_delete_the_horizon() -> None:
    """Only the stitching node is in it: the order is finished there."""
    vehicle, _ = receive(begun(1, 2, base=2), line(2, 2, update=1))
    assert (vehicle.nodes, vehicle.edges, vehicle.phase) == ((), (), Phase.FINISHED)


def test_actions_of_the_old_horizon_go_with_it() -> None:
    """Their states are not reported any more."""
    vehicle = begun(base=2, actions={3: (action(number="old"),)})
    vehicle, _ = receive(vehicle, line(2, 3, update=1, actions={3: (action(number="new"),)}))
    assert statuses(vehicle) == {"new": "WAITING"}


def test_a_hard_action_runs_alone_and_keeps_the_robot_there() -> None:
    """6.12: NONE and SOFT begin together, HARD after them, and then the robot drives on."""
    todo = (
        action("say", "a", "NONE", text="Hello"),
        action("wait", "b", "SOFT", duration=1),
        action(number="c"),
    )
    vehicle, _ = receive(Vehicle(), line(0, 2, actions={1: todo}))
    vehicle, effects = order.node_reached(vehicle, 2)
    assert effects == (Start(todo[0]), Start(todo[1]))
    assert statuses(vehicle) == {"a": "RUNNING", "b": "RUNNING", "c": "WAITING"}
    vehicle, effects = order.action_ended(vehicle, "b")
    assert effects == ()
    vehicle, effects = order.action_ended(vehicle, "a")
    assert effects == (Start(todo[2]),)
    vehicle, effects = order.action_ended(vehicle, "c")
    assert effects == (DriveTo(node(2)),)


def test_an_action_that_blocks_nothing_runs_while_the_robot_drives() -> None:
    """It begins at its node, and the drive does not wait for it; the order does."""
    say = action("say", "a", "NONE", text="Hello")
    vehicle, _ = receive(Vehicle(), line(0, 2, actions={1: (say,)}))
    vehicle, effects = order.node_reached(vehicle, 2)
    assert effects == (Start(say), DriveTo(node(2)))
    vehicle = reached(vehicle, 2)
    assert vehicle.phase is Phase.ACTIVE
    vehicle, _ = order.action_ended(vehicle, "a", result="said")
    assert (vehicle.phase, vehicle.actions[0].result) == (Phase.FINISHED, "said")


def test_an_action_that_fails_is_an_error_and_the_order_goes_on() -> None:
    """The error names the action and what to do."""
    vehicle, _ = receive(Vehicle(), line(0, 1, actions={0: (action(),)}))
    vehicle, effects = order.action_ended(vehicle, "a1", failed="nobody loaded the robot")
    assert statuses(vehicle) == {"a1": "FAILED"}
    error = vehicle.problems[0].error("2.1.0")
    assert (error.error_type, error.error_hint is None) == ("actionError", False)
    assert effects == (DriveTo(node(1)),)


def test_a_pick_leaves_a_load_and_a_drop_takes_it() -> None:
    """They are reported as the state's loads."""
    todo = {0: (action("pick", "p"),), 1: (action("drop", "d"),)}
    vehicle, _ = receive(Vehicle(), line(0, 1, actions=todo))
    vehicle, _ = order.action_ended(vehicle, "p", load=Load(load_id="soup"))
    assert vehicle.loads == (Load(load_id="soup"),)
    vehicle, _ = order.action_ended(reached(vehicle, 1), "d")
    assert vehicle.loads == ()


def test_cancelling_stops_the_robot_and_fails_what_is_left() -> None:
    """6.6.3: cancelOrder runs until the robot stands; the order's id is kept."""
    todo = {1: (action("say", "a", "NONE", text="Hi"),), 2: (action(number="b"),)}
    vehicle, _ = receive(Vehicle(), line(0, 2, actions=todo))
    vehicle, effects = instant(reached(vehicle, 1), "cancelOrder", "c")
    assert effects == (Cancel("a"), Stop())
    assert statuses(vehicle) == {"a": "FAILED", "b": "FAILED", "c": "RUNNING"}
    assert (vehicle.phase, [one.node_id for one in vehicle.nodes]) == (Phase.CANCELLING, ["n2"])
    vehicle, _ = order.stopped(vehicle)
    assert (vehicle.phase, statuses(vehicle)["c"], vehicle.order_id) == (Phase.CANCELLED, "FINISHED", "o1")
    assert (vehicle.nodes, vehicle.edges) == ((), ())


def test_a_node_that_is_reached_after_the_cancelling_counts_no_more() -> None:
    """The drive's end and the cancelling may cross each other."""
    vehicle, _ = instant(begun(), "cancelOrder", "c")
    assert order.node_reached(vehicle, 2) == (vehicle, ())


def test_cancelling_another_order_than_the_robots_is_refused() -> None:
    """Version 3.0 names the order in the action."""
    vehicle, effects = instant(begun(), "cancelOrder", "c", orderId="o2")
    assert (vehicle.phase, effects, statuses(vehicle)) == (Phase.ACTIVE, (), {"c": "FAILED"})


@pytest.mark.parametrize("phase", [Phase.NONE, Phase.FINISHED, Phase.CANCELLED])
def test_without_an_order_cancelling_fails_with_its_error(phase: Phase) -> None:
    """6.6.3.2: noOrderToCancel, a warning, with the action as its reference."""
    vehicle, effects = instant(Vehicle(phase=phase), "cancelOrder", "c")
    error = vehicle.problems[0].error("2.1.0")
    assert (error.error_type, error.error_level) == ("noOrderToCancel", "WARNING")
    assert ("actionId", "c") in [
        (one.reference_key, one.reference_value) for one in error.error_references or ()
    ]
    assert (effects, statuses(vehicle)) == ((), {"c": "FAILED"})


def test_a_new_order_after_a_cancelled_one_is_accepted_and_clears_its_actions() -> None:
    """6.6.3.1."""
    vehicle, _ = instant(begun(actions={3: (action(),)}), "cancelOrder", "c")
    vehicle, _ = order.stopped(vehicle)
    vehicle, effects = receive(vehicle, line(0, 1, order_id="o2"))
    assert (vehicle.order_id, vehicle.actions, effects) == ("o2", (), (DriveTo(node(1)),))


def test_a_pause_holds_the_next_drive_and_ends_with_its_counterpart() -> None:
    """While it lasts, actions go on, and no new drive begins."""
    vehicle, _ = receive(Vehicle(), line(0, 2, actions={1: (action(),)}))
    vehicle = reached(vehicle, 1)
    vehicle, effects = instant(vehicle, "startPause", "p")
    assert (vehicle.paused, effects, statuses(vehicle)["p"]) == (True, (Pause("p"),), "RUNNING")
    vehicle, _ = order.paused(vehicle, "p")
    vehicle, effects = order.action_ended(vehicle, "a1")
    assert (effects, statuses(vehicle)["p"]) == ((), "FINISHED")
    vehicle, effects = instant(vehicle, "stopPause", "q")
    assert effects == (Resume(), DriveTo(node(2)))
    assert statuses(vehicle)["q"] == "FINISHED"


def test_a_paused_drive_begins_anew_when_the_robot_has_come_to_rest() -> None:
    """Also where the pause ends before; cancelled meanwhile, the order ends when the robot stands."""
    vehicle, _ = instant(begun(), "startPause", "p")
    assert (vehicle.driving_to, vehicle.stopping) == (None, True)
    vehicle, effects = instant(vehicle, "stopPause", "q")
    assert effects == (Resume(),)
    cancelled, effects = instant(vehicle, "cancelOrder", "c")
    assert (effects, statuses(cancelled)["c"]) == ((), "RUNNING")
    assert statuses(order.paused(cancelled, "p")[0])["c"] == "FINISHED"
    vehicle, effects = order.paused(vehicle, "p")
    assert effects == (DriveTo(node(1)),)


@pytest.mark.parametrize(("kind", "what"), [("stateRequest", "state"), ("factsheetRequest", "factsheet")])
def test_what_is_requested_is_sent(kind: str, what: str) -> None:
    """And the action is finished."""
    vehicle, effects = instant(Vehicle(), kind, "r")
    assert (effects, statuses(vehicle)) == ((Send(what),), {"r": "FINISHED"})


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [("dance", {}), ("pick", {}), ("initPosition", {"x": 1.0}), ("say", {"text": ""}), ("say", {"text": 3})],
)
def test_an_instant_action_that_the_robot_cannot_do_fails(kind: str, parameters: dict[str, object]) -> None:
    """Unknown, for nodes only, or with other parameters: FAILED, an error, and nothing is begun."""
    vehicle, effects = instant(Vehicle(), kind, "i", **parameters)
    assert (effects, statuses(vehicle)) == ((), {"i": "FAILED"})
    assert [one.reason for one in vehicle.problems] == [Reason.INSTANT_ACTION]


def test_an_instant_action_that_comes_twice_is_done_once() -> None:
    """The same actionId: a message may be repeated."""
    once, effects = instant(begun(), "say", "i", text="Hello")
    assert len(effects) == 1
    assert instant(once, "say", "i", text="Hello") == (once, ())


def test_instant_actions_that_have_ended_can_be_cleared() -> None:
    """What runs stays, and the order's actions stay."""
    vehicle, _ = instant(begun(actions={1: (action(),)}), "say", "runs", text="Hello")
    vehicle, _ = instant(vehicle, "stateRequest", "ended")
    vehicle, _ = instant(vehicle, "clearInstantActions", "clear")
    assert statuses(vehicle) == {"a1": "WAITING", "runs": "RUNNING", "clear": "FINISHED"}


def failed_for_now() -> Vehicle:
    """A pick that may be tried again, and that has failed at the first node."""
    vehicle, _ = receive(Vehicle(), line(0, 1, actions={0: (replace(action(), retriable=True),)}))
    vehicle, effects = order.action_ended(vehicle, "a1", failed="nobody came")
    assert (statuses(vehicle), effects) == ({"a1": "RETRIABLE"}, ())
    assert [one.reason for one in vehicle.problems] == [Reason.ACTION]
    return vehicle


def test_an_action_that_is_retriable_waits_until_it_is_tried_again() -> None:
    """6.6.9 of 3.0: the robot stands until then, and drives on when it has succeeded."""
    vehicle, effects = instant(failed_for_now(), "retry", "r", actionId="a1")
    assert (effects, statuses(vehicle)) == (
        (Start(replace(action(), retriable=True)),),
        {"a1": "RUNNING", "r": "FINISHED"},
    )
    vehicle, effects = order.action_ended(vehicle, "a1")
    assert (effects, statuses(vehicle)["a1"]) == ((DriveTo(node(1)),), "FINISHED")


def test_an_action_that_is_retriable_can_be_skipped_or_cancelled() -> None:
    """Then it has failed; another than one that waits for it cannot be tried again."""
    vehicle, effects = instant(failed_for_now(), "skipRetry", "s", actionId="a1")
    assert (effects, statuses(vehicle)) == ((DriveTo(node(1)),), {"a1": "FAILED", "s": "FINISHED"})
    vehicle, effects = instant(vehicle, "retry", "r", actionId="a1")
    assert (effects, statuses(vehicle)["r"]) == ((), "FAILED")
    vehicle, _ = instant(failed_for_now(), "cancelOrder", "c")
    assert (statuses(vehicle), vehicle.phase) == ({"a1": "FAILED", "c": "FINISHED"}, Phase.CANCELLED)


def test_a_single_action_runs_alone_and_lets_the_robot_drive() -> None:
    """6.2.2 of 3.0."""
    todo = tuple(action("say", number, "SINGLE", text="Hi") for number in ("a", "b"))
    vehicle, _ = receive(Vehicle(), line(0, 2, actions={1: todo}))
    assert vehicle.passed_node() is not None
    vehicle, effects = order.node_reached(vehicle, 2)
    assert effects == (Start(todo[0]), DriveTo(node(2)))
    vehicle, effects = order.action_ended(vehicle, "a")
    assert (effects, statuses(vehicle)) == ((Start(todo[1]),), {"a": "FINISHED", "b": "RUNNING"})


def test_no_more_than_16_instant_actions_run_at_once() -> None:
    """One more fails; what stops the robot is taken all the same."""
    vehicle = begun()
    for number in range(17):
        vehicle, effects = instant(vehicle, "say", f"s{number}", text="Hello")
    assert (effects, statuses(vehicle)["s15"], statuses(vehicle)["s16"]) == ((), "RUNNING", "FAILED")
    vehicle, _ = instant(vehicle, "cancelOrder", "c")
    assert vehicle.phase is Phase.CANCELLING


def test_instant_actions_that_have_ended_do_not_pile_up() -> None:
    """A hundred requests leave 32 states, the newest."""
    vehicle = Vehicle()
    for number in range(100):
        vehicle, _ = instant(vehicle, "stateRequest", f"r{number}")
    assert list(statuses(vehicle)) == [f"r{number}" for number in range(68, 100)]


def test_a_drive_that_fails_is_reported_and_tried_again() -> None:
    """The error goes when the node is reached."""
    vehicle, effects = order.drive_failed(begun(), 2, "somebody stands in the way", "Make way.")
    assert (vehicle.driving_to, effects) == (None, ())
    assert [(one.reason, one.hint) for one in vehicle.problems] == [(Reason.DRIVE, "Make way.")]
    vehicle, effects = order.retry(vehicle)
    assert effects == (DriveTo(node(1)),)
    assert reached(vehicle, 1).problems == ()


def test_who_stops_the_robot_at_its_page_pauses_the_order() -> None:
    """It drives on when the pause is ended, and not before."""
    vehicle, _ = order.drive_failed(begun(), 2, "stopped on the page", "", by_people=True)
    assert (vehicle.paused, order.retry(vehicle)[1]) == (True, ())


def test_a_late_word_of_another_drive_changes_nothing() -> None:
    """Only the node that is driven to can be reached or missed."""
    vehicle = begun()
    assert order.node_reached(vehicle, 4) == (vehicle, ())
    assert order.drive_failed(vehicle, 4, "", "") == (vehicle, ())
    assert order.action_ended(vehicle, "unknown") == (vehicle, ())


def test_the_robot_passes_a_node_where_nothing_is_to_be_done() -> None:
    """Not the last of the base, not one with a heading, and not one where an action blocks."""
    assert begun().passed_node() == node(1)
    assert begun(base=1).passed_node() is None
    assert begun(theta=0.0).passed_node() is None
    assert begun(actions={1: (action(),)}).passed_node() is None
    quiet = (action("say", "s", "NONE", text="Hi"),)
    assert begun(actions={1: quiet}).passed_node() == node(1, actions=quiet)
    assert begun(1, 2).passed_node() is None


EVENTS = {
    OrderEvent.NEW: lambda vehicle: receive(vehicle, line(0, 1, order_id="o2")),
    OrderEvent.UPDATE: lambda vehicle: receive(vehicle, line(3, 4, update=1)),
    OrderEvent.CANCEL: lambda vehicle: instant(vehicle, "cancelOrder", "c"),
    OrderEvent.ALL_DONE: lambda vehicle: (reached(vehicle, 1, 2, 3), ()),
    OrderEvent.ALL_STOPPED: order.stopped,
}


def in_phase(phase: Phase) -> Vehicle:
    """A vehicle in this phase, with the order o1 unless it never had one."""
    active = begun()
    cancelling, _ = instant(active, "cancelOrder", "c0")
    return {
        Phase.NONE: Vehicle(),
        Phase.ACTIVE: active,
        Phase.FINISHED: reached(active, 1, 2, 3),
        Phase.CANCELLING: cancelling,
        Phase.CANCELLED: order.stopped(cancelling)[0],
    }[phase]


@pytest.mark.parametrize(("phase", "event"), list(itertools.product(Phase, OrderEvent)))
def test_every_phase_of_an_order_and_everything_that_happens_to_it(phase: Phase, event: OrderEvent) -> None:
    """A pair of the table leads where the table says; each other pair leaves the phase as it is."""
    expected = NEXT.get((phase, event), phase)
    if (phase, event) == (Phase.NONE, OrderEvent.UPDATE):
        expected = Phase.NONE  # without an order it is a new one, and its first node is too far away
    after, _ = EVENTS[event](in_phase(phase))
    assert after.phase is expected


@pytest.mark.parametrize(("status", "event"), list(itertools.product(ActionStatus, Event)))
def test_every_status_of_an_action_and_everything_that_happens_to_it(
    status: ActionStatus, event: Event
) -> None:
    """What has ended stays as it is; only what runs can succeed."""
    after = Tracked(action(), status).after(event, "result")
    allowed = {
        "WAITING": {"start": "RUNNING", "fail": "FAILED", "cancel": "FAILED"},
        "RUNNING": {
            "succeed": "FINISHED",
            "fail": "FAILED",
            "cancel": "FAILED",
            "fail_for_now": "RETRIABLE",
        },
        "RETRIABLE": {"start": "RUNNING", "fail": "FAILED", "cancel": "FAILED"},
    }
    assert str(after.status) == allowed.get(str(status), {}).get(str(event), str(status))
    assert (after.result is None) is ((status, event) not in actions.NEXT)


@pytest.mark.parametrize("phase", Phase)
@pytest.mark.usefixtures("version")
def test_the_state_of_every_phase_fits_the_schema(phase: Phase) -> None:
    """Also with errors, loads, actions and without a position."""
    vehicle = replace(in_phase(phase), loads=(Load(load_id="soup"),))
    vehicle, _ = order.drive_failed(vehicle, vehicle.driving_to or 0, "blocked", "hint")
    for facts in (AT_START, replace(AT_START, connected=False, map_id="", charge_percent=50.0)):
        assert strict_problems(Kind.STATE, encode(state(vehicle, facts, HEADER, LIMITS))) == []
