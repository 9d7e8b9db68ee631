"""The rejections of 6.6.4 in version 2.1, which 3.0 tells apart in 6.1.4.1 to 6.1.4.10."""

from typing import Any

import pytest
from chefbot_vda5050.messages import Error, Level, OperatingMode, Order
from chefbot_vda5050.order import mode_changed
from chefbot_vda5050.problems import ROWS, Reason
from chefbot_vda5050.vehicle import CLEARING, Facts, Vehicle
from msgspec.structs import replace
from vda5050_orders import AT_START, LIMITS, action, edge, instant, line, node, receive


def with_edge(**fields: Any) -> Order:
    """An order of two nodes, whose edge has these fields."""
    return replace(line(0, 1), edges=(edge(0, **fields),))


def refused(vehicle: Vehicle, order: Order, facts: Facts = AT_START) -> tuple[Error, Error]:
    """The error of 2.1 and of 3.0; the vehicle keeps its order and does nothing new."""
    after, effects = receive(vehicle, order, facts)
    assert effects == ()
    assert replace(after, problems=()) == replace(vehicle, problems=())
    (problem,) = after.problems
    errors = problem.error("2.1.0"), problem.error("3.0.0")
    for error in errors:
        references = {one.reference_key: one.reference_value for one in error.error_references or ()}
        assert references["orderId"] == order.order_id
        assert references["orderUpdateId"] == str(order.order_update_id)
        assert error.error_hint
    assert errors[0].error_level is Level.WARNING
    return errors


IN_3_0 = {
    "6.1.4.1": "VALIDATION_FAILURE",
    "6.1.4.2": "UNSUPPORTED_PARAMETER",
    "6.1.4.3": "INVALID_ORDER_ACTION",
    "6.1.4.4": "OUTDATED_ORDER_UPDATE",
    "6.1.4.5": "SAME_ORDER_UPDATE_ID",
    "6.1.4.6": "OTHER_ORDER_ACTIVE",
    "6.1.4.7": "START_NODE_OUT_OF_RANGE",
    "6.1.4.8": "NO_ROUTE_TO_TARGET",
    "6.1.4.9": "MOBILE_ROBOT_NOT_AVAILABLE",
    "6.1.4.10": "UNKNOWN_MAP_ID",
    "6.1.2": "INVALID_ORDER_UPDATE",
    "6.1.3.1": "ORDER_UPDATE_FOLLOWING_CANCEL",
}
"""The ten rejections and two more, by the sections of 3.0."""

ACTIVE, _ = receive(Vehicle(), line(0, 3, base=2))

CASES = {
    "6.1.4.1 no node": (Vehicle(), replace(line(0, 0), nodes=()), "validationError", "no node"),
    "6.1.4.1 too many edges": (Vehicle(), replace(line(0, 1), edges=()), "validationError", "need 1 edges"),
    "6.1.4.1 a gap": (
        Vehicle(),
        replace(line(0, 1), nodes=(node(0), node(2))),
        "validationError",
        "sequenceId 4",
    ),
    "6.1.4.1 another edge": (
        Vehicle(),
        replace(line(0, 1), edges=(replace(edge(0), end_node_id="n7"),)),
        "validationError",
        "does not lead",
    ),
    "6.1.4.1 too many nodes": (
        Vehicle(),
        line(0, 1000),
        "validationError",
        "1001 nodes, expected at most 1000",
    ),
    "6.1.4.1 too many actions": (
        Vehicle(),
        line(0, 1, actions={1: tuple(action(number=f"a{index}") for index in range(1001))}),
        "validationError",
        "1001 actions, expected at most 1000",
    ),
    "6.1.4.1 not released": (Vehicle(), line(0, 1, base=-1), "validationError", "not released"),
    "6.1.4.1 released after the horizon": (
        Vehicle(),
        replace(line(0, 2, base=0), nodes=(node(0), node(1, released=False), node(2))),
        "validationError",
        "comes after",
    ),
    "6.1.4.1 an edge ends the base": (
        Vehicle(),
        replace(line(0, 1, base=0), edges=(edge(0),)),
        "validationError",
        "ends with an edge",
    ),
    "6.1.4.1 an action twice": (
        Vehicle(),
        line(0, 1, actions={0: (action(),), 1: (action(),)}),
        "validationError",
        "twice",
    ),
    "6.1.4.2 zones": (Vehicle(), replace(line(0, 1), zone_set_id="z"), "orderError", "zoneSetId"),
    "6.1.4.2 trajectory": (Vehicle(), with_edge(trajectory={"degree": 1}), "orderError", "trajectory"),
    "6.1.4.2 corridor": (Vehicle(), with_edge(corridor={"leftWidth": 1}), "orderError", "corridor"),
    "6.1.4.2 slower": (Vehicle(), with_edge(max_speed=0.01), "orderError", "maxSpeed"),
    "6.1.4.2 slower turns": (Vehicle(), with_edge(max_rotation_speed=0.1), "orderError", "maxRotationSpeed"),
    "6.1.4.2 lower": (Vehicle(), with_edge(max_height=0.1), "orderError", "maxHeight"),
    "6.1.4.2 lift": (Vehicle(), with_edge(min_height=0.1), "orderError", "minHeight"),
    "6.1.4.2 backwards": (Vehicle(), with_edge(orientation=3.1), "orderError", "orientation"),
    "6.1.4.2 no turns": (Vehicle(), with_edge(rotation_allowed=False), "orderError", "rotationAllowed"),
    "6.1.4.2 turns before": (
        Vehicle(),
        with_edge(orientation=0.0, reach_orientation_before_entering=True),
        "orderError",
        "reachOrientationBeforeEntering",
    ),
    "6.1.4.2 a line's direction": (Vehicle(), with_edge(direction="left"), "orderError", "direction"),
    "6.1.4.2 no position": (
        Vehicle(),
        replace(line(0, 1), nodes=(node(0), replace(node(1), node_position=None))),
        "orderError",
        "nodePosition",
    ),
    "6.1.4.3 unknown action": (Vehicle(), line(0, 1, actions={1: (action("fly"),)}), "orderError", "'fly'"),
    "6.1.4.3 parameter": (
        Vehicle(),
        line(0, 1, actions={1: (action(height=2.0),)}),
        "orderError",
        "'height'",
    ),
    "6.1.4.3 missing parameter": (
        Vehicle(),
        line(0, 1, actions={1: (action("wait"),)}),
        "orderError",
        "'duration'",
    ),
    "6.1.4.3 type of a parameter": (
        Vehicle(),
        line(0, 1, actions={1: (action("wait", duration=True),)}),
        "orderError",
        "expected FLOAT",
    ),
    "6.1.4.3 too long": (
        Vehicle(),
        line(0, 1, actions={1: (action("wait", duration=3601.0),)}),
        "orderError",
        "3600",
    ),
    "6.1.4.3 on an edge": (Vehicle(), with_edge(actions=(action(),)), "orderError", "edges"),
    "6.1.4.3 instant ones": (
        Vehicle(),
        line(0, 1, actions={0: (action("cancelOrder"),)}),
        "orderError",
        "for INSTANT",
    ),
    "6.1.4.4 lower update": (
        receive(ACTIVE, line(2, 4, update=5))[0],
        line(2, 4, update=4),
        "orderUpdateError",
        "older than 5",
    ),
    "6.1.4.5 same update": (ACTIVE, line(0, 2, base=2), "orderUpdateError", "another content"),
    "6.1.4.6 other order": (ACTIVE, line(0, 1, order_id="o2"), "orderError", "'o1' is not finished"),
    "6.1.4.7 start": (Vehicle(), line(1, 2), "noRouteError", "1.00 m from node 'n1'"),
    "6.1.4.10 map": (Vehicle(), line(0, 1, map_id="roof"), "orderError", "'roof'"),
    "6.1.2 no continuation": (ACTIVE, line(1, 4, update=1), "orderUpdateError", "base ends at 'n2'"),
    "6.1.2 changed node": (
        ACTIVE,
        line(2, 3, update=1, actions={2: (action(),)}),
        "orderUpdateError",
        "cannot change",
    ),
    "6.1.3.1 cancelled": (
        instant(ACTIVE, "cancelOrder", "c")[0],
        line(2, 3, update=1),
        "orderUpdateError",
        "was cancelled",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_an_order_is_refused_as_the_standard_says(case: str) -> None:
    """The type of the error, what it names, and that the robot goes on with what it has."""
    vehicle, order, kind, text = CASES[case]
    in_2_1, in_3_0 = refused(vehicle, order)
    section = case.partition(" ")[0]
    assert (in_2_1.error_type, in_3_0.error_type) == (kind, IN_3_0[section])
    assert in_3_0.error_level is (Level.CRITICAL if section == "6.1.4.2" else Level.WARNING)
    assert text in (in_2_1.error_description or "")


def test_every_rejection_of_3_0_has_a_test_by_its_section() -> None:
    """Two depend on the robot: 6.1.4.8 is in ``test_vda5050_agent``, and 6.1.4.9 follows here."""
    tested = {case.partition(" ")[0] for case in CASES}
    assert set(IN_3_0) - tested == {"6.1.4.8", "6.1.4.9"}
    of_reasons = {row.section_3_0: row.type_3_0 for row in ROWS.values()}
    assert {section: of_reasons[section] for section in IN_3_0} == IN_3_0


@pytest.mark.parametrize("mode", sorted(CLEARING))
def test_6_1_4_9_in_other_modes_no_order_begins(mode: OperatingMode) -> None:
    """The error goes when the mode allows orders again."""
    errors = refused(Vehicle(), line(0, 1), replace(AT_START, mode=mode))
    assert [one.error_type for one in errors] == ["orderError", IN_3_0["6.1.4.9"]]
    assert errors[0].error_description == f"the operating mode is {mode}"
    vehicle, _ = receive(Vehicle(), line(0, 1), replace(AT_START, mode=mode))
    after, _ = mode_changed(vehicle, OperatingMode.AUTOMATIC)
    assert (len(vehicle.problems), after.problems) == (1, ())


def test_a_robot_that_is_lost_or_out_of_reach_takes_no_order() -> None:
    """It could not tell whether the first node is near."""
    assert refused(Vehicle(), line(0, 1), replace(AT_START, localized=False))[0].error_type == "noRouteError"
    assert refused(Vehicle(), line(0, 1), replace(AT_START, connected=False))[0].error_type == "orderError"


def test_the_same_order_twice_is_ignored() -> None:
    """6.6.4.3: the master may not have seen the state yet; the header of the second is another."""
    again = replace(line(0, 3, base=2), header_id=1, timestamp="2026-01-02T03:04:06.000Z")
    assert receive(ACTIVE, again) == (ACTIVE, ())


def test_a_rejection_stays_until_an_order_is_accepted() -> None:
    """6.6.4: and then it goes."""
    vehicle, _ = receive(Vehicle(), line(1, 2))
    assert len(vehicle.problems) == 1
    vehicle, _ = receive(vehicle, line(0, 1))
    assert vehicle.problems == ()


def test_the_deviation_of_the_first_node_widens_its_range() -> None:
    """6.6.3.1: how an order begins after one was cancelled between two nodes."""
    vehicle, _ = receive(Vehicle(), line(1, 2, allowed_deviation_xy=1.0))
    assert vehicle.last_node_id == "n1"


def test_limits_above_the_robots_own_are_obeyed_anyway() -> None:
    """An edge that allows more than the robot can is accepted."""
    order = with_edge(max_speed=0.34, max_rotation_speed=2.0, max_height=2.0, orientation=0.0, length=1.0)
    assert receive(Vehicle(), order)[0].order_id == "o1"
    unknown = replace(LIMITS, turn_max_rad_s=None)
    vehicle, _ = receive(Vehicle(), order, AT_START, unknown)
    assert "is not known" in vehicle.problems[0].text


def test_every_reason_has_its_name_in_both_versions_and_what_to_do() -> None:
    """Names of 2.x are in camelCase, those of 3.0 in capitals."""
    assert set(ROWS) == set(Reason)
    for row in ROWS.values():
        assert row.type_2_1[0].islower()
        assert row.type_3_0.isupper()
        assert row.hint.endswith(".")
