"""Extension of Sphinx: fills the page of methods and topics with what a running daemon answers to ``describe``."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from structlog.testing import capture_logs

from chefbotd.clock import run_virtual
from chefbotd.rpc.models import Description
from chefbotd.settings import load
from chefbotd.settings.loader import packaged
from chefbotd.testing.daemon import simulated_robot

PAGE = "reference/socket"
PLACEHOLDER = "% describe"


def setup(app: Any) -> dict[str, bool]:
    """Sphinx: calls us with the text of each page."""
    app.connect("source-read", _fill)
    return {"parallel_read_safe": True}


def _fill(app: object, page: str, source: list[str]) -> None:
    """Put methods and topics into their page."""
    if page != PAGE:
        return
    if PLACEHOLDER not in source[0]:
        raise ValueError(f"docs/{PAGE}.md has no line {PLACEHOLDER!r}, where methods and topics belong")
    source[0] = source[0].replace(PLACEHOLDER, "\n".join(lines_of(run_virtual(_describe()))))


async def _describe() -> Description:
    """What a simulated robot with everything answers."""
    with capture_logs():
        async with simulated_robot(load(packaged("chefbot_lidar"))) as robot:
            return await robot.client.describe()


def lines_of(description: Description) -> Iterator[str]:
    """The description as Markdown."""
    yield f"Protocol {description.protocol}."
    yield "\n## Methods\n"
    for name, method in sorted(description.methods.items()):
        yield f"### `{name}`\n"
        yield f"{method.summary} Role: {method.role or 'none'}.\n"
        yield from _fields("Parameters", method.params)
        yield from _fields("Result", method.result)
    yield "\n## Topics\n"
    for name, topic in sorted(description.topics.items()):
        yield f"### Topic `{name}`\n"
        yield f"{topic.summary}\n"
        yield from _fields("Data", topic.data)
    yield "\n## Errors\n"
    yield "| kind | code | meaning | ends the connection |\n|---|---:|---|---|"
    for name, error in sorted(description.errors.items()):
        yield f"| `{name}` | {error.code} | {_cell(error.meaning)} | {'yes' if error.closes else 'no'} |"


def _fields(title: str, schema: Mapping[str, Any]) -> Iterator[str]:
    """A table of an object's members, and one for each kind of object inside it."""
    kinds = schema.get("$defs", {})
    yield from _table(title, schema, kinds)
    for name, kind in kinds.items():
        yield from _table(f"In each `{name}`", kind, kinds)


def _table(title: str, schema: Mapping[str, Any], kinds: Mapping[str, Any]) -> Iterator[str]:
    properties = schema.get("properties", {})
    if not properties:
        return
    required = schema.get("required", ())
    yield f"{title}:\n"
    yield "| name | type | default |\n|---|---|---|"
    for name, field in properties.items():
        default = "required" if name in required and "default" not in field else _default(field)
        yield f"| `{name}` | {_cell(_type(field, kinds))} | {default} |"
    yield ""


def _default(field: Mapping[str, Any]) -> str:
    return f"`{json.dumps(field['default'])}`" if "default" in field else ""


def _type(field: Mapping[str, Any], kinds: Mapping[str, Any]) -> str:
    """A schema's type in a few words, with its bounds; ``kinds`` are the objects and enumerations that it may name."""
    if "$ref" in field:
        name = str(field["$ref"]).rpartition("/")[2]
        return f"`{name}`" if "properties" in kinds.get(name, {}) else _type(kinds.get(name, {}), kinds)
    if "anyOf" in field:
        return " or ".join(_type(kind, kinds) for kind in field["anyOf"])
    if "enum" in field:
        return ", ".join(f"`{json.dumps(value)}`" for value in field["enum"])
    if "const" in field:
        return f"`{json.dumps(field['const'])}`"
    kind = str(field.get("type", "anything"))
    if kind == "array" and "prefixItems" in field:  # of a fixed length
        members = [_type(item, kinds) for item in field["prefixItems"]]
        return f"array of {len(members)}: {', '.join(dict.fromkeys(members))}"
    if kind == "array":
        return f"array of {_type(field.get('items', {}), kinds)}"
    words = {
        "minimum": "at least",
        "exclusiveMinimum": "above",
        "maximum": "at most",
        "exclusiveMaximum": "below",
    }
    bounds = [f"{text} {field[key]:g}" for key, text in words.items() if key in field]
    return ", ".join([kind, *bounds])


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
