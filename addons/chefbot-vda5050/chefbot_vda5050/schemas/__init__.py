"""The public JSON schemas of VDA 5050, a folder for each version; ``README.md`` names their source."""

import json
from functools import cache
from importlib import resources
from typing import Any

from chefbot_vda5050 import versions
from chefbot_vda5050.topics import Kind


@cache
def schema(kind: Kind, number: str) -> dict[str, Any]:
    """The schema of a topic's messages in the version of this number; 2.0 has that of 2.1."""
    folder = "v3_0" if versions.of(number) is versions.V3 else "v2_1"
    path = resources.files(__name__).joinpath(folder, f"{kind}.json")
    content: dict[str, Any] = json.loads(path.read_text())
    return content


@cache
def _validator(kind: Kind, number: str) -> Any:
    from jsonschema import Draft202012Validator

    return Draft202012Validator(schema(kind, number), format_checker=Draft202012Validator.FORMAT_CHECKER)


def problems(kind: Kind, message: bytes) -> list[str]:
    """What the schema of the version that a message names finds wrong with it; it needs jsonschema."""
    try:
        content = json.loads(message)
    except ValueError as error:
        return [f"no JSON: {error}"]
    number = versions.of_message(content).number
    found = _validator(kind, number).iter_errors(content)
    return [f"{'/'.join(str(step) for step in one.absolute_path) or '.'}: {one.message}" for one in found]
