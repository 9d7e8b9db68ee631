"""Recording without asyncio: same names, plain calls."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Coroutine
from typing import TYPE_CHECKING, Any, TypeVar

from chefbotd.client.client import Client

if TYPE_CHECKING:
    from chefbotd.client import models

T = TypeVar("T")


class SyncRecording(ABC):
    """Every method is ``Client``'s of the same name."""

    _client: Client

    @abstractmethod
    def _run(self, work: Coroutine[Any, Any, T]) -> T:
        """The result of a coroutine, which runs on the client's loop."""

    def start_recording(self, name: str | None = None) -> models.RecordingStarted:
        """Record everything into a file on the robot's computer; ``name`` is how its name begins."""
        return self._run(self._client.start_recording(name))

    def stop_recording(self) -> models.RecordingEnded:
        """End the recording."""
        return self._run(self._client.stop_recording())

    def list_recordings(self) -> models.RecordingList:
        """Every recording in the robot's folder, the newest first."""
        return self._run(self._client.list_recordings())

    def save_ring(self, reason: str | None = None) -> models.RingSaved:
        """Write the last minutes, which are kept in memory, into a file; ``reason`` is a part of its name."""
        return self._run(self._client.save_ring(reason))
