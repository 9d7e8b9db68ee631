"""What records become on the wire, and in ``describe``."""

import math
from collections import UserDict
from typing import Annotated, Literal

import pytest
from msgspec import Meta

from chefbotd.components.tuning.models import Wheels
from chefbotd.core.record import Record
from chefbotd.motion.pid import PidParameters
from chefbotd.rpc.encoding import UnknownData, encode, plain, schema


class Reading(Record, frozen=True):
    """A reading of a gauge.

    Its frame is that of the base.
    """

    level: Annotated[float | None, Meta(description="from 0 to 1")]
    levels: tuple[float, ...] = ()
    frame_id: Literal["base"] = "base"


def test_a_number_that_is_not_finite_is_null() -> None:
    """At any depth: JSON has no other word for it."""
    assert plain(Reading(math.nan, (0.5, math.inf, -math.inf))) == {
        "level": None,
        "levels": [0.5, None, None],
        "frame_id": "base",
    }


def test_what_has_no_record_is_sent_as_it_came() -> None:
    """Its members are attributes, whatever they are called; what it lacks is an ``AttributeError``."""
    data = UnknownData(self=1, members_told={"a": 2.5})
    assert plain(data) == {"self": 1, "members_told": {"a": 2.5}}
    assert data.members_told == {"a": 2.5}
    with pytest.raises(AttributeError, match="UnknownData has no member 'other'"):
        _ = data.other


def test_parameters_and_mappings_are_sent_as_objects() -> None:
    """Gains are parameters of the configuration, under the names that ``set_pid`` takes."""
    gains = PidParameters(kp=400.0, ki=100.0, output_limit=255.0)
    assert plain(Wheels(wheels={"left": gains}))["wheels"]["left"]["kp"] == 400.0
    assert encode(UserDict(a=1)) == b'{"a":1}'


def test_what_is_no_value_is_refused() -> None:
    """A fault of ours, which names the class."""
    with pytest.raises(NotImplementedError, match="object cannot be sent"):
        encode({"a": object()})


def test_a_schema_says_what_the_class_says() -> None:
    """Descriptions without the docstring's indentation, null where it may come, defaults, and what is fixed."""
    assert schema(Reading) == {
        "title": "Reading",
        "type": "object",
        "description": "A reading of a gauge.\n\nIts frame is that of the base.",
        "properties": {
            "level": {"anyOf": [{"type": "number"}, {"type": "null"}], "description": "from 0 to 1"},
            "levels": {"type": "array", "items": {"type": "number"}, "default": ()},
            "frame_id": {"type": "string", "const": "base", "default": "base"},
        },
        "required": ["level"],
    }
    properties = schema(Wheels)["properties"]["wheels"]["additionalProperties"]["properties"]
    assert properties["kp"] == {"maximum": 1e6, "minimum": 0, "title": "Kp", "type": "number"}
