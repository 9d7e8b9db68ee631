"""The error text of a refused value: the field, the expected value, and the given one."""

from collections.abc import Sequence

from pydantic import ValidationError
from pydantic_core import ErrorDetails


def explain(problem: ValidationError, *, confidential: bool = False) -> tuple[str, list[dict[str, str]]]:
    """A message that names each field, its value (unless confidential) and what was expected, and the same as data."""
    errors = problem.errors(include_url=False, include_context=False)
    fields = [_field_problem(error, confidential=confidential) for error in errors]
    return "; ".join(_sentence(f) for f in fields), fields


def _field_problem(error: ErrorDetails, *, confidential: bool) -> dict[str, str]:
    value = "nothing" if error["type"] == "missing" else _shortened(repr(error["input"]))
    if confidential:
        return {"field": "params", "expected": error["msg"], "got": "what is not repeated here"}
    message = error["msg"].removeprefix("Value error, ")
    expected = "No such parameter" if error["type"] == "extra_forbidden" else message
    return {"field": _path(error["loc"]), "expected": expected, "got": value}


def _sentence(problem: dict[str, str]) -> str:
    return f"{problem['field']}: {problem['expected']}, got {problem['got']}"


def _path(location: Sequence[int | str]) -> str:
    return ".".join(str(step) for step in location) or "params"


def _shortened(text: str) -> str:
    return text if len(text) <= 60 else text[:60] + "..."
