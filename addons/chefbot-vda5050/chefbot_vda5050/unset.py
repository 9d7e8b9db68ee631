"""Values that stand for a field that is not set, as masters write them whose messages have every field (ROS, C++).

A ROS message has no optional fields: what nobody has set is empty text, zero, false or an empty list. Such a value is
taken as left out where it could not be meant. So is a whole number that is written with a decimal point as the number.
Fields have their names of version 2.1.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Final

WHOLE_NUMBERS: Final = frozenset(
    {"headerId", "orderUpdateId", "sequenceId", "lastNodeSequenceId", "reach", "referenceStateHeaderId"}
)
TEXTS: Final = frozenset(
    {
        *("zoneSetId", "direction", "orientationType"),
        *("nodeDescription", "edgeDescription", "actionDescription", "mapDescription"),
    }
)
"""Empty text is no value of these."""

LIMITS: Final = frozenset({"maxSpeed", "maxHeight", "minHeight", "maxRotationSpeed", "length"})
"""Zero of these says nothing, or nothing could drive there."""

WRITTEN_ALWAYS: Final = ("direction", "orientationType")
"""Whoever writes one of these empty writes every field: then false and zero of an edge's other fields mean nothing."""


def without_unset(content: Any) -> Any:
    """A message without the fields that are not set, and with whole numbers; what is no object stays as it is."""
    if not isinstance(content, dict):
        return content
    whole: dict[str, Any] = _whole(content)
    for node in _objects(whole.get("nodes")):
        _leave_out(node, TEXTS)
        _clean(node.get("nodePosition"))
    for edge in _objects(whole.get("edges")):
        _clean_edge(edge)
    for part in (*_objects(whole.get("nodes")), *_objects(whole.get("edges")), whole):
        for action in _objects(part.get("actions")):
            _leave_out(action, TEXTS)
    _leave_out(whole, TEXTS)
    return whole


def _whole(content: Any, field: str = "") -> Any:
    """The same with whole numbers as such; ``value`` is an action's parameter, in which anything may stand."""
    if isinstance(content, dict):
        return {key: one if key == "value" else _whole(one, key) for key, one in content.items()}
    if isinstance(content, list):
        return [_whole(one, field) for one in content]
    if field in WHOLE_NUMBERS and isinstance(content, float) and content.is_integer():
        return int(content)
    return content


def _clean(position: Any) -> None:
    if isinstance(position, dict):
        _leave_out(position, TEXTS)


def _clean_edge(edge: dict[str, Any]) -> None:
    writes_always = any(edge.get(name) == "" for name in WRITTEN_ALWAYS)
    _leave_out(edge, TEXTS)
    unset = [name for name in LIMITS if _is_zero(edge.get(name))]
    if _has_nothing(edge.get("trajectory"), "controlPoints"):
        unset.append("trajectory")
    if isinstance(corridor := edge.get("corridor"), dict) and not any(
        corridor.get(side) for side in ("leftWidth", "rightWidth")
    ):
        unset.append("corridor")
    if writes_always:
        unset += [name for name in ("rotationAllowed", "orientation") if not edge.get(name)]
    for name in unset:
        edge.pop(name, None)


def _leave_out(part: dict[str, Any], names: frozenset[str]) -> None:
    for name in names:
        if part.get(name) == "":
            del part[name]


def _has_nothing(part: Any, name: str) -> bool:
    return isinstance(part, Mapping) and not part.get(name)


def _is_zero(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value == 0


def _objects(parts: Any) -> Iterator[dict[str, Any]]:
    return (one for one in (parts if isinstance(parts, list) else ()) if isinstance(one, dict))
