"""What navigation does for the zones of a map, which do not know it: it says what they would do, and drives by them."""

from typing import Final

from chefbotd.components.navigation.skill_requests import (
    SKILL,
    ExamineZones,
    MapChecked,
    UseZones,
    ZonesExamined,
)
from chefbotd.components.worker.process import Worker
from chefbotd.components.zones.service import Places, ZonesService
from chefbotd.components.zones.zone_file import Zones, write_zones

TIMEOUT_S: Final = 20.0
"""It is a moment's work in the worker, which may be at something else."""


def join_zones(worker: Worker, zones: ZonesService) -> None:
    """Have the worker say what zones would do, and plan by them once they are changed."""

    async def examine(wanted_zones: Zones, places: Places) -> tuple[str, ...]:
        request = ExamineZones(write_zones(wanted_zones), dict(places))
        examined = await worker.request(
            SKILL, request, ZonesExamined, deadline_s=TIMEOUT_S, is_replayed=False
        )
        return examined.concerns

    async def use() -> str:
        checked = await worker.request(SKILL, UseZones(), MapChecked, deadline_s=TIMEOUT_S, is_replayed=False)
        return checked.problem

    zones.examine, zones.use = examine, use
