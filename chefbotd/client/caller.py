"""The base of every group of the client's methods."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from chefbotd.client.parsing import parse

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

    async def _ask(
        self, model: str | None, method: str, /, *, on_progress: ProgressListener | None = None, **params: Any
    ) -> Any:
        """Call with the parameters that are not None. The answer is parsed as the model of this name; None: not at all.

        Importing the models takes about 0.3 s. It is done before the call, so that a robot never drives while they load;
        what needs no model, such as an emergency stop, does not wait for them.
        """
        if model is not None:
            from chefbotd.client import models
        answer = await self.call(method, on_progress=on_progress or ignore_progress, **given(**params))
        return None if model is None else parse(getattr(models, model), answer)


def given(**params: Any) -> dict[str, Any]:
    """The parameters that are not None: the daemon knows the defaults of the others."""
    return {name: value for name, value in params.items() if value is not None}


def ignore_progress(_done: float, _total: float, _text: str) -> None:
    """Take a report of progress. Each one allows the answer more time, also where nobody wants to hear it."""
