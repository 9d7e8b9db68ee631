"""The skill that makes maps on a bench: its disk is in memory, its clock stands until it is set."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from chefbotd.clock import ManualClock
from chefbotd.components.mapping.algorithms.parameters import MappingParameters
from chefbotd.components.mapping.algorithms.saved import Arrays
from chefbotd.components.mapping.skill import MappingSkill
from chefbotd.components.mapping.skill_requests import (
    Finish,
    MappingRequest,
    MappingSkillParameters,
)
from chefbotd.components.maps.events import MappingChanged, MapSaved
from chefbotd.components.worker.messages import pack_body
from chefbotd.components.worker.skill import JobStep, Struct
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import OdometryUpdated
from chefbotd.core.occupancy_grid import OccupancyGrid
from tests.chefbotd.components.worker.skills.drives import measured

SCANS = 130


@dataclass
class Memory:
    """A folder of maps that forgets with the test; ``full`` refuses to save, ``stubborn`` to forget."""

    maps: dict[str, list[tuple[OccupancyGrid, Arrays]]] = field(default_factory=dict)
    kept: tuple[OccupancyGrid, Arrays] | None = None
    autosaves: int = 0
    full: bool = False
    stubborn: bool = False
    damage: str = ""

    def save(self, name: str, grid: OccupancyGrid, slam: Arrays) -> int:
        """A version more."""
        self._write()
        self.maps.setdefault(name, []).append((grid, slam))
        return len(self.maps[name])

    def read_slam(self, name: str) -> Arrays | None:
        """The latest."""
        return self.maps[name][-1][1]

    def autosave(self, grid: OccupancyGrid, slam: Arrays) -> None:
        """Keep it."""
        self._write()
        self.kept = (grid, slam)
        self.autosaves += 1

    def has_autosave(self) -> bool:
        """Whether there is one."""
        return self.kept is not None

    def read_autosave(self) -> Arrays | None:
        """It."""
        return None if self.kept is None else self.kept[1]

    def autosave_damage(self) -> str:
        """What is wrong with its newest states."""
        return self.damage

    def discard_autosave(self) -> None:
        """Forget it."""
        if self.stubborn:
            raise Refused(RefusalKind.STORAGE_FAILED, "cannot remove .autosave.map: Permission denied")
        self.kept = None

    def _write(self) -> None:
        if self.full:
            raise Refused(RefusalKind.STORAGE_FAILED, "cannot save: the disk is full")


class Bench:
    """A skill, its disk and its clock, and all that it has told."""

    def __init__(
        self, memory: Memory | None = None, session: str = "one", lidars: tuple[str, ...] = ("top",)
    ) -> None:
        self.clock = ManualClock(50.0)
        self.memory = memory or Memory()
        parameters = MappingSkillParameters(
            lidars=lidars,
            folder=Path("/nowhere"),
            versions_kept=3,
            session=session,
            mapping=MappingParameters(),
        )
        self.skill = MappingSkill(parameters.model_dump_json().encode(), self.clock, self.memory)
        self.told: list[Struct] = []

    def drive(
        self, first: int, last: int, messages: Iterable[ScanMeasured | OdometryUpdated] | None = None
    ) -> None:
        """Give it a part of the tour, in its own time."""
        for message in messages or measured(first, last):
            late_s = message.stamp_s - self.clock.now_s()
            self.clock.advance(late_s if late_s > 0 else 0.0)
            if isinstance(message, ScanMeasured):
                self.told += self.skill.take_scan(message)
            else:
                self.told += self.skill.take_odometry(message)
                self.told += self.skill.step(self.clock.now_s())

    def ask(self, request: MappingRequest) -> MappingChanged:
        """Have something done at once."""
        answer = self.skill.handle(pack_body(request))
        assert isinstance(answer, MappingChanged)
        return answer

    def finish(self, name: str) -> tuple[MapSaved, list[JobStep]]:
        """Finish the map; the answer, and how far it said to be."""
        job, progress = self.skill.handle(pack_body(Finish(name))), []
        assert not isinstance(job, Struct)
        while True:
            try:
                progress.append(next(job))
            except StopIteration as end:
                answer: MapSaved = end.value
                return answer, progress

    def of(self, kind: type[Struct]) -> list[Struct]:
        """What it told of this kind."""
        return [each for each in self.told if isinstance(each, kind)]
