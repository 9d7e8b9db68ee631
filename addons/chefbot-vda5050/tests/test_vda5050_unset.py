"""Orders as masters write them whose messages have every field, and messages that would cost too much."""

import json
from typing import Any

import pytest
from chefbot_vda5050.acceptance import unsupported_fields
from chefbot_vda5050.messages import LONGEST_LIST, InstantActions, MalformedMessage, Order, decode, encode
from chefbot_vda5050.vehicle import Limits
from vda5050_orders import action, line

ROS_EDGE: dict[str, Any] = {
    "edgeDescription": "",
    "maxSpeed": 0.0,
    "maxHeight": 0.0,
    "minHeight": 0.0,
    "orientation": 0.0,
    "orientationType": "",
    "direction": "",
    "rotationAllowed": False,
    "maxRotationSpeed": 0.0,
    "length": 0.0,
    "trajectory": {"degree": 0.0, "knotVector": [], "controlPoints": []},
}
LIMITS = Limits(speed_max_m_s=0.5, turn_max_rad_s=1.0, height_m=1.0)


def order(**edge: Any) -> dict[str, Any]:
    """An order over one edge with these fields, as JSON."""
    content: dict[str, Any] = json.loads(encode(line(0, 1, actions={0: (action(loadType="soup"),)})))
    content["edges"][0] |= edge
    return content


def read(content: dict[str, Any]) -> Order:
    """The order."""
    return decode(json.dumps(content).encode(), Order)


def test_what_a_ros_message_leaves_empty_is_not_set() -> None:
    """Every field of an edge is there, and none of them means anything."""
    content = order(**ROS_EDGE) | {"zoneSetId": ""}
    content["nodes"][0] |= {"nodeDescription": ""}
    assert read(content) == read(order())
    assert unsupported_fields(read(content).edges[0], LIMITS) == []


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("direction", "left"),
        ("maxSpeed", 0.01),
        ("maxHeight", 0.5),
        ("rotationAllowed", False),
        ("orientation", 1.0),
        ("trajectory", {"degree": 1, "knotVector": [0, 1], "controlPoints": [{"x": 0, "y": 0}]}),
        ("corridor", {"leftWidth": 0.5, "rightWidth": 0.0}),
    ],
)
def test_what_is_set_is_still_refused_where_it_cannot_be_obeyed(field: str, value: Any) -> None:
    """The field is named."""
    (problem,) = unsupported_fields(read(order(**{field: value})).edges[0], LIMITS)
    assert problem.startswith(f"edge.{field}: ")


def test_a_whole_number_may_have_a_decimal_point() -> None:
    """1.0 is 1; 1.5 is none, and is named. A parameter of an action stays as it is."""
    content = order()
    content |= {"headerId": 7.0, "orderUpdateId": 0.0}
    for part in (*content["nodes"], *content["edges"]):
        part["sequenceId"] = float(part["sequenceId"])
    content["nodes"][0]["actions"][0]["actionParameters"] = [
        {"key": "sequenceId", "value": {"sequenceId": 1.0}}
    ]
    decoded = read(content)
    assert [node.sequence_id for node in decoded.nodes] == [0, 2]
    assert isinstance(decoded.header_id, int)
    assert isinstance(decoded.nodes[0].actions[0].parameter("sequenceId")["sequenceId"], float)
    content["edges"][0]["sequenceId"] = 1.5
    with pytest.raises(MalformedMessage, match="sequenceId"):
        read(content)


def test_an_order_has_a_name() -> None:
    """An empty one would be that of a robot without an order."""
    with pytest.raises(MalformedMessage, match="orderId"):
        read(order() | {"orderId": ""})


@pytest.mark.parametrize("field", ["nodes", "edges", "actions"])
def test_a_list_of_more_entries_than_are_meant_is_not_gone_through(field: str) -> None:
    """It is named with its length."""
    content = order() | {field: [{}] * (LONGEST_LIST + 1)}
    kind: Any = InstantActions if field == "actions" else Order
    with pytest.raises(MalformedMessage, match=f"{field} has {LONGEST_LIST + 1} entries"):
        decode(json.dumps(content).encode(), kind)


def test_many_lists_count_together() -> None:
    """A thousand actions on each of a hundred nodes."""
    content = order()
    content["nodes"] = [{"actions": [{}] * 1000} for _ in range(100)]
    with pytest.raises(MalformedMessage, match="expected at most 20000"):
        read(content)
