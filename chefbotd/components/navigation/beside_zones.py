"""What navigation does for the zones and edits of a map: it says what they would do, and drives by them."""

from typing import Final

from chefbotd.components.map_edits.service import MapEditsService
from chefbotd.components.navigation.skill_requests import (
    SKILL,
    Examine,
    Examined,
    MapChecked,
    UseZones,
)
from chefbotd.components.worker.process import Worker
from chefbotd.components.zones.service import ZonesService

TIMEOUT_S: Final = 20.0
"""It is a moment's work in the worker, which may be at something else."""


def join_zones(worker: Worker, zones: ZonesService, edits: MapEditsService) -> None:
    """Have the worker say what zones and edits would do, and plan by zones once they are changed.

    Edits are used as localization has read them.
    """

    async def examine(request: Examine) -> tuple[str, ...]:
        examined = await worker.request(SKILL, request, Examined, deadline_s=TIMEOUT_S, is_replayed=False)
        return examined.concerns

    async def use() -> str:
        checked = await worker.request(SKILL, UseZones(), MapChecked, deadline_s=TIMEOUT_S, is_replayed=False)
        return checked.problem

    zones.examine = lambda drawn, places: examine(Examine(dict(places), zones=drawn))
    edits.examine = lambda drawn, places: examine(Examine(dict(places), edits=drawn))
    zones.use = use
