"""Messages on the wire: the schemas of the standard are the judge."""

import json
from typing import Any

import msgspec
import pytest
from chefbot_vda5050 import schemas
from chefbot_vda5050.messages import (
    InstantActions,
    MalformedMessage,
    Order,
    decode,
    encode,
)
from chefbot_vda5050.topics import Headers, Kind, RobotName, parse_topic, seconds_of, timestamp_of
from vda5050_orders import action, line


def test_an_order_with_everything_is_valid_and_comes_back_as_it_was() -> None:
    """Encoded, it fits the schema of 2.1; decoded, it is equal."""
    order = line(0, 3, base=1, actions={1: (action(loadType="soup"),)}, theta=-1.5, allowed_deviation_xy=0.2)
    data = encode(order)
    assert schemas.problems(Kind.ORDER, data) == []
    assert json.loads(data)["nodes"][0]["nodePosition"]["allowedDeviationXY"] == 0.2
    assert decode(data, Order) == order


@pytest.mark.parametrize(
    ("path", "value", "where"),
    [
        (("orderId",), 7, "orderId"),
        (("orderUpdateId",), -1, "orderUpdateId"),
        (("nodes", 0, "released"), "yes", "released"),
        (("nodes", 0, "nodePosition", "x"), "1", "nodePosition.x"),
        (("nodes", 0, "nodePosition", "theta"), 4.0, "theta"),
        (("nodes", 0, "actions", 0, "blockingType"), "MAYBE", "blockingType"),
        (("edges", 0, "startNodeId"), None, "startNodeId"),
        (("orderId",), "x" * 257, "length <= 256 - at `\\$.orderId`"),
        (("nodes", 0, "actions", 0, "actionId"), "x" * 257, "actionId"),
    ],
)
def test_a_field_of_another_type_or_range_is_named(path: tuple[Any, ...], value: Any, where: str) -> None:
    """The text of the error has the path of the field, for the robot's errorDescription."""
    content = json.loads(encode(line(0, 1, actions={0: (action(),)})))
    part = content
    for step in path[:-1]:
        part = part[step]
    part[path[-1]] = value
    with pytest.raises(MalformedMessage, match=where):
        decode(json.dumps(content).encode(), Order)


def test_a_message_of_more_than_4_mib_is_not_even_read() -> None:
    """It would keep the robot's side busy for a second or more."""
    with pytest.raises(MalformedMessage, match="has 4194305 bytes, expected at most 4194304"):
        decode(b" " * (4 * 2**20 + 1), Order)


@pytest.mark.parametrize("data", [b"", b"{", b"[]", b"null", b"\xff\xfe", b'"order"', b"[" * 100_000])
def test_what_is_no_message_is_malformed(data: bytes) -> None:
    """Whatever the bytes are, there is this error and no other."""
    with pytest.raises(MalformedMessage):
        decode(data, Order)


def test_a_null_is_a_field_that_is_left_out() -> None:
    """Some masters send optional fields as null."""
    content = json.loads(encode(line(0, 1)))
    content["zoneSetId"] = None
    content["nodes"][0]["nodePosition"]["theta"] = None
    assert decode(json.dumps(content).encode(), Order) == line(0, 1)


def test_instant_actions_have_the_name_of_1_1_too() -> None:
    """Masters of 2.0 are known that call the list 'instantActions'."""
    content = json.loads(encode(line(0, 0)))
    actions = [msgspec.to_builtins(action("cancelOrder", "c", "NONE"))]
    for name in ("actions", "instantActions"):
        message = decode(json.dumps(content | {name: actions}).encode(), InstantActions)
        assert [one.action_id for one in message.actions] == ["c"]


def test_topics_are_written_and_read_back() -> None:
    """The interface may have several levels."""
    name = RobotName("chefbot", "r1", "plant/vda5050", "v3")
    assert name.topic(Kind.ORDER) == "plant/vda5050/v3/chefbot/r1/order"
    assert parse_topic(name.topic(Kind.STATE)) == (name, Kind.STATE)
    assert parse_topic("uagv/v2/a/b/other") is None
    assert parse_topic("state") is None
    for odd in ("uagv/v2//x/state", "uagv/v2/chefbot/r$1/connection", "//a/b/state"):
        assert parse_topic(odd) is None


@pytest.mark.parametrize("serial", ["", "a/b", "#", "a+b", "$SYS", "a\n"])
def test_a_name_that_mqtt_keeps_for_itself_is_refused(serial: str) -> None:
    """A serial number with such a letter would listen to other robots."""
    with pytest.raises(ValueError, match="level of a topic"):
        RobotName("chefbot", serial)


def test_timestamps_are_utc_with_milliseconds() -> None:
    """2026-01-02T03:04:05.250Z is 1767323045.25 seconds after 1970."""
    assert timestamp_of(1767323045.25) == "2026-01-02T03:04:05.250Z"
    assert timestamp_of(1767323045.0) == "2026-01-02T03:04:05.000Z"
    assert seconds_of("2026-01-02T03:04:05.25Z") == 1767323045.25
    assert seconds_of("2026-01-02T04:04:05.250+01:00") == 1767323045.25
    assert seconds_of("2026-01-02T03:04:05") == 1767323045.0


def test_header_ids_count_each_topic_by_itself() -> None:
    """6.4: per topic, from 0, one more with each message."""
    headers = Headers(RobotName("chefbot", "r1"), "2.1.0")
    kinds = (Kind.STATE, Kind.STATE, Kind.CONNECTION, Kind.STATE)
    assert [headers.next(kind, 0.0)["header_id"] for kind in kinds] == [0, 1, 0, 2]
