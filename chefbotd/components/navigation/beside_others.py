"""What navigation does for components that do not know it.

It tells localization of its goals, and whether the map in use can be driven on. It says what zones and edits of a map
would do, and drives by them.
"""

from typing import Final

from chefbotd.bus import Bus
from chefbotd.components.localization.service import LocalizationService
from chefbotd.components.map_edits.service import MapEditsService
from chefbotd.components.navigation.events import NavigationChanged
from chefbotd.components.navigation.skill_requests import (
    SKILL,
    CheckMap,
    Examine,
    Examined,
    MapChecked,
    UseZones,
)
from chefbotd.components.worker.process import Worker
from chefbotd.components.zones.service import ZonesService

ON_ITS_WAY: Final = ("planning", "driving", "recovering", "paused")

TIMEOUT_S: Final = 20.0
"""It is a moment's work in the worker, which may be at something else."""


def join_localization(bus: Bus, worker: Worker, localization: LocalizationService) -> None:
    """Have localization know of goals, and ask the worker what navigation finds wrong with a map."""

    def note_goal(event: NavigationChanged) -> None:
        localization.note_goal(has_goal=event.state in ON_ITS_WAY)

    async def check_map() -> str:
        checked = await worker.request(SKILL, CheckMap(), MapChecked, deadline_s=TIMEOUT_S)
        return checked.problem

    bus.add_handler(note_goal, NavigationChanged)
    localization.check_map = check_map


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

    zones.file.examine = lambda drawn, places: examine(Examine(dict(places), zones=drawn))
    edits.file.examine = lambda drawn, places: examine(Examine(dict(places), edits=drawn))
    zones.file.use = use
