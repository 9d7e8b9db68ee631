"""Recording: one Python method per method of the socket."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from chefbotd.client.parsing import parse

if TYPE_CHECKING:
    from chefbotd.client import models
    from chefbotd.client.wire import ProgressListener


class RecordingMethods(ABC):
    """The methods of recording. ``call`` is what a subclass provides. Every error is a ``ChefbotError``."""

    @abstractmethod
    async def call(
        self, method: str, /, *, on_progress: ProgressListener | None = None, **params: Any
    ) -> dict[str, Any]:
        """Call a method by its name; returns the answer's ``result`` unchanged."""

    async def start_recording(self, name: str | None = None) -> models.RecordingStarted:
        """Record everything into a file on the robot's computer; ``name`` is how its name begins."""
        from chefbotd.client import models

        named: dict[str, Any] = {} if name is None else {"name": name}
        return parse(
            models.RecordingStarted, await self.call("start_recording", on_progress=_ignore, **named)
        )

    async def stop_recording(self) -> models.RecordingEnded:
        """End the recording."""
        from chefbotd.client import models

        return parse(models.RecordingEnded, await self.call("stop_recording", on_progress=_ignore))

    async def list_recordings(self) -> models.RecordingList:
        """Every recording in the robot's folder, the newest first."""
        from chefbotd.client import models

        return parse(models.RecordingList, await self.call("list_recordings", on_progress=_ignore))

    async def save_ring(self, reason: str | None = None) -> models.RingSaved:
        """Write the last minutes, which are kept in memory, into a file; ``reason`` is a part of its name."""
        from chefbotd.client import models

        why: dict[str, Any] = {} if reason is None else {"reason": reason}
        return parse(models.RingSaved, await self.call("save_ring", on_progress=_ignore, **why))


def _ignore(_done: float, _total: float, _text: str) -> None:
    """Take a report, which allows the request more time."""
