"""Both versions from one record: names, values and forms, as the schema of each wants them."""

import json
from typing import Any

import pytest
from chefbot_vda5050 import versions
from chefbot_vda5050.factsheet import factsheet
from chefbot_vda5050.messages import (
    ActionState,
    ActionStatus,
    BlockingType,
    Connection,
    ConnectionState,
    Factsheet,
    InstantActions,
    Level,
    MalformedMessage,
    OperatingMode,
    Order,
    State,
    decode,
    encode,
)
from chefbot_vda5050.paths import intermediate_path, planned_path
from chefbot_vda5050.problems import Problem, Reason
from chefbot_vda5050.state import state, visualization
from chefbot_vda5050.topics import Kind
from chefbot_vda5050.vehicle import Facts, Limits, Vehicle
from msgspec.structs import replace
from vda5050_fakes import strict_problems
from vda5050_orders import AT_START, HEADER, LIMITS, action, edge, line, node

from chefbotd.settings import load, packaged

IN_3_0 = HEADER | {"version": "3.0.0"}


def content(message: Any) -> dict[str, Any]:
    """A message as it is on the wire."""
    parsed: dict[str, Any] = json.loads(encode(message))
    return parsed


@pytest.mark.usefixtures("version")
def test_an_order_comes_back_as_it_was_in_both_versions() -> None:
    """Encoded, it fits its schema and has no field that its version does not know."""
    fields = {
        "max_speed": 0.3,
        "max_height": 0.2,
        "min_height": 0.1,
        "orientation": 0.0,
        "edge_description": "e",
    }
    order = replace(
        line(0, 1, base=1, actions={1: (action(loadType="soup"),)}, theta=-1.5, allowed_deviation_xy=0.2),
        edges=(edge(0, **fields),),
    )
    data = encode(order)
    assert strict_problems(Kind.ORDER, data) == []
    assert decode(data, Order) == order


def test_an_order_of_3_0_has_its_names_and_ellipses() -> None:
    """By hand: 7.3 of 3.0 against 6.7 of 2.1."""
    order = replace(
        line(0, 1, allowed_deviation_xy=0.2), **IN_3_0, edges=(edge(0, max_speed=0.3, max_height=0.2),)
    )
    now = content(order)
    assert now["nodes"][0]["nodePosition"]["allowedDeviationXY"] == {"a": 0.2, "b": 0.2, "theta": 0.0}
    (only,) = now["edges"]
    assert (only["maximumSpeed"], only["maximumMobileRobotHeight"]) == (0.3, 0.2)
    assert not {"startNodeId", "endNodeId", "maxSpeed"} & set(only)


def test_of_an_ellipse_the_smaller_axis_counts() -> None:
    """Whoever is in that circle is in the ellipse."""
    now = content(replace(line(0, 0, allowed_deviation_xy=0.2), **IN_3_0))
    now["nodes"][0]["nodePosition"]["allowedDeviationXY"] = {"a": 0.5, "b": 0.1, "theta": 1.0}
    position = decode(json.dumps(now).encode(), Order).nodes[0].node_position
    assert position is not None
    assert position.allowed_deviation_xy == 0.1


@pytest.mark.parametrize(
    "deviation", [0.2, {"a": 0.2, "b": 0.2}, {"a": "0.2", "b": 0.2, "theta": 0}, [], True]
)
def test_what_is_no_ellipse_is_malformed(deviation: Any) -> None:
    """A number is one of 2.1 only."""
    now = content(replace(line(0, 0, allowed_deviation_xy=0.2), **IN_3_0))
    now["nodes"][0]["nodePosition"]["allowedDeviationXY"] = deviation
    with pytest.raises(MalformedMessage, match=r"nodes\[0\].nodePosition.allowedDeviationXY"):
        decode(json.dumps(now).encode(), Order)


@pytest.mark.parametrize(
    ("path", "value", "where"),
    [
        (("edges", 0, "maximumSpeed"), "fast", "maximumSpeed"),
        (("edges", 0, "sequenceId"), None, "sequenceId"),
        (("edges", 0), 7, "edges"),
        (("nodes", 0), 7, "nodes"),
        (("nodes", 0, "nodePosition", "x"), "1", "nodePosition.x"),
        (("nodes",), 7, "nodes"),
        (("edges",), {}, "edges"),
    ],
)
def test_a_malformed_field_is_named_as_its_version_names_it(
    path: tuple[Any, ...], value: Any, where: str
) -> None:
    """The sentence is for who has written the message."""
    now = content(replace(line(0, 1), **IN_3_0))
    part: Any = now
    for step in path[:-1]:
        part = part[step]
    part[path[-1]] = value
    with pytest.raises(MalformedMessage, match=where):
        decode(json.dumps(now).encode(), Order)


def test_an_edge_too_many_is_left_to_the_order_s_judgement() -> None:
    """It has no ends, and it is the count that is wrong."""
    order = replace(line(0, 1), **IN_3_0)
    too_many = decode(encode(replace(order, edges=(edge(0), edge(1)))), Order)
    assert [(one.start_node_id, one.end_node_id) for one in too_many.edges] == [("n0", "n1"), ("", "")]


def test_names_and_values_of_the_other_version_are_none() -> None:
    """SINGLE is no blockingType of 2.1; maxSpeed is no field of 3.0, as actionDescription is none."""
    single = replace(action(), blocking_type=BlockingType.SINGLE)
    order = content(replace(line(0, 0, actions={0: (single,)}), **IN_3_0))
    assert decode(json.dumps(order).encode(), Order).nodes[0].actions[0].blocking_type is BlockingType.SINGLE
    with pytest.raises(MalformedMessage, match="SINGLE of another version"):
        decode(json.dumps(order | {"version": "2.1.0"}).encode(), Order)
    edges = content(replace(line(0, 1), **IN_3_0))
    edges["edges"][0] |= {"maxSpeed": 0.1, "startNodeId": "n7"}
    (only,) = decode(json.dumps(edges).encode(), Order).edges
    assert (only.max_speed, only.start_node_id) == (None, "n0")


@pytest.mark.usefixtures("version")
def test_instant_actions_are_known_by_the_names_of_each_version() -> None:
    """``initPosition`` of 2.1 is ``initializePosition`` in 3.0; what its parameters hold is nobody's name."""
    asked = InstantActions(**HEADER, actions=(action("initPosition", "i", "NONE", x={"maxSpeed": 1}),))
    data = encode(asked)
    assert strict_problems(Kind.INSTANT_ACTIONS, data) == []
    assert decode(data, InstantActions) == asked
    name = "initializePosition" if HEADER["version"][0] == "3" else "initPosition"
    (only,) = content(asked)["actions"]
    assert (only["actionType"], only["actionParameters"][0]["value"]) == (name, {"maxSpeed": 1})


@pytest.mark.usefixtures("version")
@pytest.mark.parametrize("connection", ConnectionState)
def test_every_connection_state_is_valid_in_both_versions(connection: ConnectionState) -> None:
    """HIBERNATING is OFFLINE where there is no such state."""
    data = encode(Connection(**HEADER, connection_state=connection))
    assert strict_problems(Kind.CONNECTION, data) == []
    if connection is not ConnectionState.HIBERNATING:
        assert decode(data, Connection).connection_state is connection


@pytest.mark.usefixtures("version")
@pytest.mark.parametrize("mode", OperatingMode)
@pytest.mark.parametrize("reason", Reason)
def test_every_mode_and_every_problem_is_valid_in_both_versions(mode: OperatingMode, reason: Reason) -> None:
    """Each mode and each level has its word in each version."""
    vehicle = Vehicle(problems=(Problem(reason, "edge.maxSpeed is unknown", (("field", "edge.maxSpeed"),)),))
    data = encode(state(vehicle, replace(AT_START, mode=mode), HEADER, LIMITS))
    assert strict_problems(Kind.STATE, data) == []
    (error,) = decode(data, State).errors
    name = "maximumSpeed" if HEADER["version"][0] == "3" else "maxSpeed"
    assert error.error_description == f"edge.{name} is unknown"
    assert error.error_references is not None
    assert error.error_references[0].reference_value == f"edge.{name}"


def test_the_hint_names_the_action_of_its_version() -> None:
    """A robot that is lost; in 3.0 that is FATAL (6.6.5.4)."""
    hints = []
    for number in ("2.1.0", "3.0.0"):
        lost = state(Vehicle(), replace(AT_START, localized=False), HEADER | {"version": number}, LIMITS)
        (error,) = decode(encode(lost), State).errors
        hints.append((error.error_level, "initializePosition" in (error.error_hint or "")))
    assert hints == [(Level.WARNING, False), (Level.FATAL, True)]


def test_states_of_instant_actions_are_by_themselves_in_3_0() -> None:
    """In 2.1 they are among the others; RETRIABLE is still RUNNING there."""
    of_order = ActionState(action_id="a", action_status=ActionStatus.RETRIABLE, action_type="pick")
    instant = ActionState(action_id="i", action_status=ActionStatus.FINISHED, action_type="initPosition")
    found: dict[str, list[Any]] = {}
    for number in ("2.1.0", "3.0.0"):
        whole = state(Vehicle(), AT_START, HEADER | {"version": number}, LIMITS)
        now = content(replace(whole, action_states=(of_order,), instant_action_states=(instant,)))
        found[number] = [
            [(one["actionId"], one["actionStatus"], one["actionType"]) for one in now.get(name, ())]
            for name in ("actionStates", "instantActionStates")
        ]
    assert found == {
        "2.1.0": [[("a", "RUNNING", "pick"), ("i", "FINISHED", "initPosition")], []],
        "3.0.0": [[("a", "RETRIABLE", "pick")], [("i", "FINISHED", "initializePosition")]],
    }


@pytest.mark.usefixtures("version")
@pytest.mark.parametrize("settings", [None, load(packaged("chefbot_lidar"))])
def test_the_factsheet_is_valid_in_both_versions(settings: Any) -> None:
    """With and without the robot's configuration; it names fields and actions as its version does."""
    data = encode(factsheet(settings, HEADER, carries_kg=2.0, seconds=1.0))
    assert strict_problems(Kind.FACTSHEET, data) == []
    now, is_3 = json.loads(data), HEADER["version"][0] == "3"
    features = now["protocolFeatures"]
    names = {one["parameter"] for one in features["optionalParameters"]}
    assert ("order.edges.maximumSpeed" in names, "order.edges.maxSpeed" in names) == (is_3, not is_3)
    actions = features["mobileRobotActions" if is_3 else "agvActions"]
    assert ("initializePosition" in {one["actionType"] for one in actions}) is is_3
    assert decode(data, Factsheet).protocol_features["agvActions"][0]["actionType"] == "pick"


def test_the_path_is_a_polyline_from_the_robot_with_times() -> None:
    """At x = 1 of a path along x from 0 to 5 m, at 0.5 m/s: 2 m further in 4 s, and 3 m in 6 s, where it ends."""
    facts = replace(AT_START, x_m=1.0, path=tuple((float(x), 0.0) for x in range(6)))
    path = planned_path(facts)
    assert path is not None
    xs = [point["x"] for point in path["trajectory"]["controlPoints"]]
    assert xs == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert path["trajectory"]["knotVector"] == [0.0, 0.0, 0.25, 0.5, 0.75, 1.0, 1.0]
    near = intermediate_path(facts, "2026-01-02T03:04:05.000Z", Limits(speed_max_m_s=0.5))
    assert near is not None
    assert [(one["x"], one["eta"][17:19]) for one in near["polyline"]] == [
        (1.0, "05"),
        (2.0, "07"),
        (3.0, "09"),
        (4.0, "11"),
    ]


@pytest.mark.usefixtures("version")
@pytest.mark.parametrize("points", [0, 1, 2, 49, 50, 51, 1000])
def test_a_path_of_any_length_is_valid_and_of_50_points_at_most(points: int) -> None:
    """Version 2.1 does not tell it."""
    facts: Facts = replace(AT_START, path=tuple((index * 0.01, 0.5) for index in range(points)))
    for kind, message in (
        (Kind.STATE, state(Vehicle(), facts, HEADER, LIMITS)),
        (Kind.VISUALIZATION, visualization(facts, HEADER, LIMITS, 7)),
    ):
        assert strict_problems(kind, encode(message)) == []
        now = content(message)
        assert ("plannedPath" in now) is (HEADER["version"][0] == "3" and points > 0)
        if "plannedPath" in now:
            ends = now["plannedPath"]["trajectory"]["controlPoints"]
            assert (len(ends) <= 50, ends[-1]["x"]) == (True, pytest.approx((points - 1) * 0.01))


def test_no_name_is_that_of_another_field() -> None:
    """Else what is read could be taken for something else."""
    for table in (versions.FIELDS, versions.OF_FACTSHEET):
        for column in (0, 1):
            names = [row[column] for row in table.values() if row[column] is not None]
            assert len(set(names)) == len(names)
        assert not {row[1] for row in table.values()} & {
            here for here, row in table.items() if row[1] != here
        }


def test_a_node_with_no_position_is_read_too() -> None:
    """In 3.0 as in 2.1 the order's judgement refuses it."""
    order = replace(line(0, 0), **IN_3_0, nodes=(replace(node(0), node_position=None),))
    assert decode(encode(order), Order) == order
