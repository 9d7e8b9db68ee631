"""What is never refused for its form: a stop is carried out from any JSON object that asks for one.

A robot that drives on because a reason was too long, was of the wrong type or held half of a surrogate pair would
have understood and not obeyed. So what the strict reading refuses is read once more as leniently as JSON can be.
"""

import json
from typing import Annotated, Any

from pydantic import ConfigDict, Field, field_validator, model_validator

from chefbotd.api.jsonrpc import MAX_INTEGER_DIGITS, Request
from chefbotd.api.requests import Params

MAX_REASON_CHARACTERS = 200
NO_REASON = "asked by a client"


class StopParams(Params):
    """Nothing; whatever comes all the same is passed over."""

    model_config = ConfigDict(extra="ignore")

    @model_validator(mode="before")
    @classmethod
    def _whatever_comes(cls, params: Any) -> Any:
        return params if isinstance(params, dict) else {}


class EstopParams(StopParams):
    """Why, for the people who will ask; a reason that is no text, or empty, is none."""

    reason: Annotated[str, Field(description=f"cut to {MAX_REASON_CHARACTERS} characters")] = NO_REASON

    @field_validator("reason", mode="before")
    @classmethod
    def _readable(cls, reason: Any) -> str:
        text = reason.encode(errors="replace").decode() if isinstance(reason, str) else ""
        return text.strip()[:MAX_REASON_CHARACTERS] or NO_REASON


def read_leniently(line: bytes | bytearray) -> Request | None:
    """The request in a line that strictness has refused, whatever else is wrong; None when there is none to be seen.

    What cannot be an id is answered as null. Never raises, whatever the bytes.
    """
    try:
        message = json.loads(line.decode(errors="replace"), parse_int=_int_that_fits)
    except (ValueError, RecursionError):
        return None
    if not isinstance(message, dict) or not isinstance(message.get("method"), str):
        return None
    params, request_id = message.get("params"), message.get("id")
    readable = isinstance(request_id, str | int) and not isinstance(request_id, bool)
    return Request(
        message["method"],
        params if isinstance(params, dict) else {},
        request_id if readable else None,
        "id" in message,
    )


def _int_that_fits(digits: str) -> int | None:
    return int(digits) if len(digits) <= MAX_INTEGER_DIGITS else None
