"""What navigation tells localization, which does not know it: its goals, and whether the map in use can be driven on."""

from typing import Final

from chefbotd.bus import Bus
from chefbotd.components.localization.service import LocalizationService
from chefbotd.components.navigation.events import NavigationChanged
from chefbotd.components.navigation.skill_requests import SKILL, CheckMap, MapChecked
from chefbotd.components.worker.process import Worker

ON_ITS_WAY: Final = ("planning", "driving", "recovering", "paused")

CHECK_TIMEOUT_S: Final = 20.0
"""It is a moment's work in the worker, which may be at something else."""


def join_localization(bus: Bus, worker: Worker, localization: LocalizationService) -> None:
    """Have localization know of goals, and ask the worker what navigation finds wrong with a map."""

    def note_goal(event: NavigationChanged) -> None:
        localization.note_goal(has_goal=event.state in ON_ITS_WAY)

    async def check_map() -> str:
        checked = await worker.request(SKILL, CheckMap(), MapChecked, deadline_s=CHECK_TIMEOUT_S)
        return checked.problem

    bus.add_handler(note_goal, NavigationChanged)
    localization.check_map = check_map
