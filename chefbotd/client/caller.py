"""What every group of the client's methods is built on."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from chefbotd.client.wire import ProgressListener


class Caller(ABC):
    """Calls methods of the socket. Every error is a ``ChefbotError``.

    The usual ones are ``CallError`` (refused; ``kind`` says why), ``CallTimeout`` and ``ConnectionLost``.
    """

    @abstractmethod
    async def call(
        self, method: str, /, *, on_progress: ProgressListener | None = None, **params: Any
    ) -> dict[str, Any]:
        """Call a method by its name; returns the answer's ``result`` unchanged."""


def given(**params: Any) -> dict[str, Any]:
    """The parameters that are not None: the daemon knows the defaults of the others."""
    return {name: value for name, value in params.items() if value is not None}


def ignore_progress(_done: float, _total: float, _text: str) -> None:
    """Take a report of progress. Each one allows the answer more time, also where nobody wants to hear it."""
