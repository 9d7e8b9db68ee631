"""Recognizes a client's request that says the same as its last one, from the bytes of its line.

Who drives says the same ten to fifty times a second, and only the id differs. Such a line need not be parsed again, nor
its parameters checked. What depends on the robot, or on the time, is not remembered here.
"""

import re
from typing import Self

from msgspec import Struct

from chefbotd.rpc.jsonrpc import MAX_INTEGER_DIGITS, Request
from chefbotd.rpc.models import Params

_ID = re.compile(rb'("id"[ \t]*:[ \t]*)([0-9]+)(?![0-9.eE])')
"""A member ``id`` that is a whole number. Quotes inside of a string are escaped, so this is found in no string."""


class RepeatableRequest(Struct):
    """A request, and its line before and behind the digits of its id; ``params`` once they have been checked."""

    request: Request
    before: bytes
    behind: bytes
    params: Params | None = None

    @classmethod
    def of(cls, line: bytes | bytearray, request: Request) -> Self | None:
        """The request that this line was parsed as; None where no other line is recognized by it.

        Its method must have no parameter that is called ``id``. Where characters are escaped, another key
        may be the request's id.
        """
        parts = _ID.split(line)
        if len(parts) != 4 or request.id != int(parts[2]) or b"\\u" in line:
            return None
        before, name, _, behind = parts
        return cls(request, bytes(before + name), bytes(behind))

    def recognize(self, line: bytes | bytearray) -> Request | None:
        """This request with the id of a line that says the same; None where the line says anything else."""
        before, behind = self.before, self.behind
        digits = line[len(before) : len(line) - len(behind)]
        if not (digits.isdigit() and line.startswith(before) and line.endswith(behind)):
            return None
        if len(digits) >= MAX_INTEGER_DIGITS or digits[0] == _ZERO:
            return None
        return Request(self.request.method, self.request.params, int(digits))


_ZERO = ord("0")
