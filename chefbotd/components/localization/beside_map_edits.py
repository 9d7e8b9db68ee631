"""What localization does for the edits of a map: it finds the way by them once they are changed."""

from typing import Final

from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.localization.skill_requests import SKILL, UseEdits
from chefbotd.components.map_edits.service import MapEditsService
from chefbotd.components.worker.process import Worker

TIMEOUT_S: Final = 60.0
"""For each step of making a large map ready again."""


def join_map_edits(worker: Worker, edits: MapEditsService) -> None:
    """Have the worker read the edits of the map in use again."""

    async def use() -> str:
        await worker.request(SKILL, UseEdits(), LocalizationChanged, deadline_s=TIMEOUT_S, is_replayed=False)
        return ""

    edits.use = use
