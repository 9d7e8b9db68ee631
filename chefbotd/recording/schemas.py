"""Makes the JSON Schemas of events from their classes, with every reference resolved, for simple readers."""

from collections.abc import Mapping
from typing import Any

import msgspec

POSE: Mapping[str, Any] = {
    "type": "object",
    "properties": {name: {"type": "number"} for name in ("x_m", "y_m", "heading_rad")},
}
NUMBERS: Mapping[str, Any] = {"type": "array", "items": {"type": ["number", "null"]}}
SCAN: Mapping[str, Any] = {
    "title": "ScanMeasured",
    "description": "A whole turn of a lidar, mounted at base_from_lidar; invalid readings are 0.",
    "type": "object",
    "properties": {
        "stamp_s": {"type": "number"},
        "lidar": {"type": "string"},
        "base_from_lidar": POSE,
        "scan": {
            "type": "object",
            "properties": {
                "stamp_s": {"type": "number"},
                "bearing_rad": NUMBERS,
                "range_m": NUMBERS,
                "after_s": NUMBERS,
            },
            "required": ["stamp_s", "bearing_rad", "range_m", "after_s"],
        },
    },
    "required": ["stamp_s", "lidar", "base_from_lidar", "scan"],
}
"""Of the one event whose arrays are numpy's."""


def schema_of(event_class: type[Any]) -> Mapping[str, Any]:
    """The schema of an event's JSON."""
    if event_class.__name__ == "ScanMeasured":
        return SCAN
    schema = msgspec.json.schema(event_class)
    definitions = schema.pop("$defs", {})
    resolved: Mapping[str, Any] = _resolved(schema, definitions)
    return resolved


def _resolved(schema: Any, definitions: Mapping[str, Any]) -> Any:
    if isinstance(schema, list | tuple):
        return [_resolved(each, definitions) for each in schema]
    if not isinstance(schema, dict):
        return schema
    reference = schema.get("$ref")
    if isinstance(reference, str):
        return _resolved(definitions[reference.rpartition("/")[2]], definitions)
    return {key: _resolved(value, definitions) for key, value in schema.items()}
