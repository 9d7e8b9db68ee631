"""The worker's working thread, without a socket: messages in, messages out. A skill is imported when it is needed."""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Final

import msgspec

from chefbotd.components.worker import messages
from chefbotd.components.worker.messages import FromWorker, Measurement, ToWorker, packed
from chefbotd.components.worker.skill import DependentSkill, Job, RangeSkill, Skill
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import OdometryUpdated, RangeMeasured
from chefbotd.core.record import Record
from chefbotd.extras import how_to_add_extra

if TYPE_CHECKING:  # it would load asyncio, 7 MB
    from chefbotd.clock import Clock


SKILLS: Final[Mapping[str, str]] = {
    "mapping": "chefbotd.components.mapping.skill:MappingSkill",
    "localization": "chefbotd.components.localization.skill:LocalizationSkill",
    "navigation": "chefbotd.components.navigation.skill:NavigationSkill",
}
"""Name -> module and class, which is made with its parameters as JSON and the worker's clock."""

EXTRA: Final = "navigation"
NEEDS: Final = ("numba", "scipy", "llvmlite")


class CannotLoad(Exception):
    """A skill that cannot work in this installation, and what to do; ready to be shown."""


def loaded(name: str, parameters: bytes, clock: "Clock") -> Skill:
    """The skill of this name.

    Raises:
        CannotLoad: what it needs is not installed.
    """
    module, _, kind = SKILLS[name].partition(":")
    try:
        make: Callable[[bytes, Clock], Skill] = getattr(import_module(module), kind)
    except ModuleNotFoundError as missing:
        if missing.name not in NEEDS:
            raise
        raise CannotLoad(
            f"{name} needs {missing.name}, which is not installed: {how_to_add_extra(EXTRA)}"
        ) from missing
    return make(parameters, clock)


STEP_S: Final = 0.05
"""How often the skills have a turn of their own."""


class _Running(Record, frozen=True):
    request: messages.SkillRequest
    job: Job


class Runner:
    """The skills, and the jobs that they are at; ``doing`` says what it is busy with, and since when.

    ``renew`` is called, and does not return, when all is loaded and some of it had to be compiled.
    """

    def __init__(self, clock: "Clock", renew: Callable[[messages.Configure], None] | None = None) -> None:
        self._clock, self._renew = clock, renew
        self._skills: dict[str, Skill] = {}
        self._jobs: list[_Running] = []
        self._range_skills: dict[str, RangeSkill] = {}
        self._step_at_s = float("-inf")
        self.doing: tuple[str, float] | None = None

    @property
    def wait_s(self) -> float:
        """How long there is nothing to do but for what comes meanwhile."""
        return 0.0 if self._jobs else min(max(self._step_at_s - self._clock.now_s(), 0.0), STEP_S)

    def take_message(self, message: ToWorker) -> Iterator[FromWorker]:
        """Do what the daemon asks; yields what is to be sent, as it comes."""
        match message:
            case messages.Measured():
                yield from self._take_measurement(messages.event_in(message))
            case messages.SkillRequest():
                yield from self._begin(message)
            case messages.Cancel():
                yield from self._cancel(message.id)
            case messages.Configure():
                yield from self._load(message)

    def _take_measurement(self, event: Measurement) -> Iterator[FromWorker]:
        match event:
            case ScanMeasured():
                for name, skill in self._skills.items():
                    yield from self._telling(name, "a scan", skill.take_scan(event))
            case OdometryUpdated():
                for name, skill in self._skills.items():
                    yield from self._telling(name, "odometry", skill.take_odometry(event))
            case RangeMeasured():
                for name, range_skill in self._range_skills.items():
                    yield from self._telling(name, "a range", range_skill.take_range(event))

    def take_turn(self) -> Iterator[FromWorker]:
        """Bring each job a step further, and let the skills do what has its own time."""
        for running in list(self._jobs):
            yield from self._advance(running)
        now_s = self._clock.now_s()
        if now_s >= self._step_at_s:
            in_time = now_s - self._step_at_s < STEP_S / 2
            self._step_at_s = STEP_S + (self._step_at_s if in_time else now_s)
            for name, skill in self._skills.items():
                yield from self._telling(name, "its own time", skill.step(now_s))

    def close(self) -> None:
        """The daemon is gone, or ends."""
        for running in self._jobs:
            running.job.close()
        for skill in self._skills.values():
            skill.close()

    def _load(self, message: messages.Configure) -> Iterator[FromWorker]:
        for name, parameters in message.skills.items():
            yield messages.Warming(name)
            self._begin_work(f"loading {name}")
            try:
                self._skills[name] = skill = loaded(name, parameters, self._clock)
                skill.warm()
            except CannotLoad as problem:
                yield messages.Unavailable(str(problem))
                return
            finally:
                self.doing = None
        self._range_skills = {
            name: skill for name, skill in self._skills.items() if isinstance(skill, RangeSkill)
        }
        for skill in self._skills.values():
            if isinstance(skill, DependentSkill):
                skill.connect(self._skills)
        if self._renew is not None and _has_compiled():
            self._renew(message)
        yield messages.Ready()

    def _begin(self, request: messages.SkillRequest) -> Iterator[FromWorker]:
        skill = self._skills.get(request.skill)
        if skill is None:
            reason = f"the worker has no skill {request.skill!r}"
            yield messages.Failed(request.id, RefusalKind.WORKER_UNAVAILABLE, reason)
            return
        self._begin_work(f"{request.skill}: a request")
        try:
            result = skill.handle(request.body)
        except Refused as refusal:
            yield messages.Failed(request.id, refusal.kind, str(refusal))
            return
        finally:
            self.doing = None
        if result is None or isinstance(result, msgspec.Struct):
            yield messages.Answer(request.id, packed(result))
        else:
            self._jobs.append(_Running(request, result))

    def _advance(self, running: _Running) -> Iterator[FromWorker]:
        request = running.request
        self._begin_work(f"{request.skill}: a job")
        try:
            done = next(running.job)
        except StopIteration as end:
            self._jobs.remove(running)
            yield messages.Answer(request.id, packed(end.value))
        except Refused as refusal:
            self._jobs.remove(running)
            yield messages.Failed(request.id, refusal.kind, str(refusal))
        else:
            yield messages.RequestProgress(request.id, done.done, done.total, done.text)
        finally:
            self.doing = None

    def _cancel(self, number: int) -> Iterator[FromWorker]:
        for running in self._jobs:
            if running.request.id == number:
                running.job.close()
                self._jobs.remove(running)
                yield messages.Failed(number, None, "it was cancelled")
                return

    def _telling(
        self, name: str, what: str, messages_of_skill: Iterable[msgspec.Struct]
    ) -> Iterator[FromWorker]:
        """Hand on what a skill tells; being busy is the skill's time, not that of whoever takes it."""
        self._begin_work(f"{name}: {what}")
        try:
            for message in messages_of_skill:
                yield messages.SkillEvent(name, packed(message), type(message).__name__)
        finally:
            self.doing = None

    def _begin_work(self, what: str) -> None:
        self.doing = (what, self._clock.now_s())


def _has_compiled() -> bool:
    """Whether a skill had to compile; one that never compiles has not loaded the compiler either."""
    compiled = sys.modules.get("chefbotd.components.worker.compiled")
    return compiled is not None and bool(compiled.has_compiled())
