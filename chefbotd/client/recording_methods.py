"""Recording: one Python method per method of the socket."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chefbotd.client.caller import Caller, given, ignore_progress
from chefbotd.client.parsing import parse

if TYPE_CHECKING:
    from chefbotd.client import models


class RecordingMethods(Caller):
    """The methods of recording."""

    async def start_recording(self, name: str | None = None) -> models.RecordingStarted:
        """Record everything into a file on the robot's computer; ``name`` is how its name begins."""
        from chefbotd.client import models

        answer = await self.call("start_recording", on_progress=ignore_progress, **given(name=name))
        return parse(models.RecordingStarted, answer)

    async def stop_recording(self) -> models.RecordingEnded:
        """End the recording."""
        from chefbotd.client import models

        return parse(models.RecordingEnded, await self.call("stop_recording", on_progress=ignore_progress))

    async def list_recordings(self) -> models.RecordingList:
        """Every recording in the robot's folder, the newest first."""
        from chefbotd.client import models

        return parse(models.RecordingList, await self.call("list_recordings", on_progress=ignore_progress))

    async def save_ring(self, reason: str | None = None) -> models.RingSaved:
        """Write the last minutes, which are kept in memory, into a file; ``reason`` is a part of its name."""
        from chefbotd.client import models

        answer = await self.call("save_ring", on_progress=ignore_progress, **given(reason=reason))
        return parse(models.RingSaved, answer)
