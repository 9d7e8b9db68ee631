"""The public JSON schemas of VDA 5050, a folder for each version; ``README.md`` names their source."""

import json
from functools import cache
from importlib import resources
from typing import Any

from chefbot_vda5050.topics import Kind


@cache
def schema(kind: Kind, version: str = "2.1") -> dict[str, Any]:
    """The schema of a topic's messages.

    Raises:
        FileNotFoundError: there is none of this version.
    """
    path = resources.files(__name__).joinpath(f"v{version.replace('.', '_')}", f"{kind}.json")
    content: dict[str, Any] = json.loads(path.read_text())
    return content


@cache
def _validator(kind: Kind, version: str) -> Any:
    from jsonschema import Draft202012Validator

    return Draft202012Validator(schema(kind, version), format_checker=Draft202012Validator.FORMAT_CHECKER)


def problems(kind: Kind, message: bytes, version: str = "2.1") -> list[str]:
    """What the schema finds wrong with a message; it needs jsonschema."""
    try:
        content = json.loads(message)
    except ValueError as error:
        return [f"no JSON: {error}"]
    found = _validator(kind, version).iter_errors(content)
    return [f"{'/'.join(str(step) for step in one.absolute_path) or '.'}: {one.message}" for one in found]
