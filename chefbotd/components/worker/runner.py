"""The worker's working thread, without a socket: messages in, messages out. A skill is imported when it is needed."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

import msgspec

from chefbotd.component import resolve
from chefbotd.component_list import own_components
from chefbotd.components.worker import messages
from chefbotd.components.worker.messages import FromWorker, Measurement, ToWorker, pack_body
from chefbotd.components.worker.skill import DependentSkill, Job, RangeSkill, Skill
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import OdometryUpdated, RangeMeasured
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence, sentence_data
from chefbotd.extras import how_to_add_extra

if TYPE_CHECKING:  # it would load asyncio, 7 MB
    from chefbotd.clock import Clock


EXTRA: Final = "navigation"
NEEDS: Final = ("numba", "scipy", "llvmlite")


class CannotLoad(Exception):
    """A skill that cannot work in this installation, and what to do; ready to be shown."""


def own_skills() -> dict[str, str]:
    """The skills of our own components by name, each with its module and class."""
    return {name: reference for component in own_components() for name, reference in component.skills.items()}


def load_skill(name: str, parameters: bytes, clock: "Clock") -> Skill:
    """The skill of this name.

    Raises:
        CannotLoad: what it needs is not installed.
    """
    module, _, kind = own_skills()[name].partition(":")
    try:
        make: Callable[[bytes, Clock], Skill] = getattr(import_module(module), kind)
    except ModuleNotFoundError as missing:
        if missing.name not in NEEDS:
            raise
        raise CannotLoad(
            f"{name} needs {missing.name}, which is not installed: {how_to_add_extra(EXTRA)}"
        ) from missing
    return make(parameters, clock)


def loaded_from(reference: str, parameters: bytes, clock: "Clock") -> Skill:
    """The skill of a stranger's component, ``module:class``."""
    make: Callable[[bytes, Clock], Skill] = resolve(reference)
    return make(parameters, clock)


STEP_S: Final = 0.05
"""How often the skills have a turn of their own."""


class _Running(Record, frozen=True):
    request: messages.SkillRequest
    job: Job


class Runner:
    """The skills, and the jobs that they are at; ``doing`` says what it is busy with, and since when.

    ``renew`` is called, and does not return, when all is loaded and some of it had to be compiled. While skills are
    loaded the context that ``away`` makes is open.
    """

    def __init__(
        self,
        clock: "Clock",
        renew: Callable[[messages.Configure], None] | None = None,
        away: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self._clock, self._renew, self._away = clock, renew, away
        self._skills: dict[str, Skill] = {}
        self._jobs: list[_Running] = []
        self._range_skills: dict[str, RangeSkill] = {}
        self._strangers: set[str] = set()
        self._left_out: dict[str, str] = {}
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
                yield from self._begin_request(message)
            case messages.Cancel():
                yield from self._cancel(message.id)
            case messages.Configure():
                with self._away():  # what is compiled may take a minute
                    yield from self._load(message)

    def _take_measurement(self, event: Measurement) -> Iterator[FromWorker]:
        match event:
            case ScanMeasured():
                for name, skill in list(self._skills.items()):
                    yield from self._telling(name, "a scan", skill.take_scan, event)
            case OdometryUpdated():
                for name, skill in list(self._skills.items()):
                    yield from self._telling(name, "odometry", skill.take_odometry, event)
            case RangeMeasured():
                for name, range_skill in list(self._range_skills.items()):
                    yield from self._telling(name, "a range", range_skill.take_range, event)

    def take_turn(self) -> Iterator[FromWorker]:
        """Bring each job a step further, and let the skills do what has its own time."""
        for running in list(self._jobs):
            yield from self._advance(running)
        now_s = self._clock.now_s()
        if now_s >= self._step_at_s:
            in_time = now_s - self._step_at_s < STEP_S / 2
            self._step_at_s = STEP_S + (self._step_at_s if in_time else now_s)
            for name, skill in list(self._skills.items()):
                yield from self._telling(name, "its own time", skill.step, now_s)

    def close(self) -> None:
        """The daemon is gone, or ends."""
        for running in self._jobs:
            running.job.close()
        for name, skill in list(self._skills.items()):
            try:
                skill.close()
            except Exception:
                if name not in self._strangers:
                    raise

    def _load(self, message: messages.Configure) -> Iterator[FromWorker]:
        self._strangers = set(message.references)
        for name, parameters in message.skills.items():
            yield messages.Warming(name)
            self._begin_work(f"loading {name}")
            try:
                if reference := message.references.get(name):
                    skill = loaded_from(reference, parameters, self._clock)
                else:
                    skill = load_skill(name, parameters, self._clock)
                self._skills[name] = skill
                skill.warm()
            except CannotLoad as problem:
                yield messages.Unavailable(str(problem))
                return
            except Exception as fault:
                if name not in self._strangers:
                    raise
                yield self._leave_out(name, fault)
            finally:
                self.doing = None
        self._range_skills = {
            name: skill for name, skill in self._skills.items() if isinstance(skill, RangeSkill)
        }
        yield from self._connect_skills()
        if self._renew is not None and _has_compiled():
            self._renew(message)
        yield messages.Ready()

    def _connect_skills(self) -> Iterator[FromWorker]:
        for name, skill in list(self._skills.items()):
            if isinstance(skill, DependentSkill):
                try:
                    skill.connect(self._skills)
                except Exception as fault:
                    if name not in self._strangers:
                        raise
                    yield self._leave_out(name, fault)

    def _leave_out(self, name: str, fault: Exception) -> messages.SkillLeftOut:
        """Go on without a stranger's skill that has failed."""
        self._left_out[name] = reason = f"{type(fault).__name__}: {fault}"
        self._skills.pop(name, None)
        self._range_skills.pop(name, None)
        return messages.SkillLeftOut(name, reason)

    def _begin_request(self, request: messages.SkillRequest) -> Iterator[FromWorker]:
        skill = self._skills.get(request.skill)
        if skill is None:
            reason = Sentence("worker.no_skill", "the worker has no skill {skill!r}", skill=request.skill)
            if why := self._left_out.get(request.skill):
                reason = Sentence(
                    "worker.skill_left_out",
                    "the skill {skill!r} is left out: {why}",
                    skill=request.skill,
                    why=why,
                )
            yield messages.Failed(request.id, RefusalKind.WORKER_UNAVAILABLE, reason)
            return
        self._begin_work(f"{request.skill}: a request")
        try:
            result = skill.handle(request.body)
        except Refused as refusal:
            yield messages.Failed(request.id, refusal.kind, str(refusal), sentence_data(refusal.words))
            return
        except Exception as fault:  # noqa: BLE001 - raised again, but for a stranger's
            yield from self._refuse_request(request, fault)
            return
        finally:
            self.doing = None
        if result is None or isinstance(result, msgspec.Struct):
            yield messages.Answer(request.id, pack_body(result))
        else:
            self._jobs.append(_Running(request, result))

    def _advance(self, running: _Running) -> Iterator[FromWorker]:
        request = running.request
        self._begin_work(f"{request.skill}: a job")
        try:
            done = next(running.job)
        except StopIteration as end:
            self._jobs.remove(running)
            yield messages.Answer(request.id, pack_body(end.value))
        except Refused as refusal:
            self._jobs.remove(running)
            yield messages.Failed(request.id, refusal.kind, str(refusal), sentence_data(refusal.words))
        except Exception as fault:  # noqa: BLE001 - raised again, but for a stranger's
            self._jobs.remove(running)
            yield from self._refuse_request(request, fault)
        else:
            yield messages.RequestProgress(request.id, done.done, done.total, done.text)
        finally:
            self.doing = None

    def _refuse_request(self, request: messages.SkillRequest, fault: Exception) -> Iterator[FromWorker]:
        """Refuse what a stranger's skill fails at, and go on without it; our own ends the worker."""
        if request.skill not in self._strangers:
            raise fault
        left_out = self._leave_out(request.skill, fault)
        yield messages.Failed(request.id, RefusalKind.WORKER_UNAVAILABLE, left_out.reason)
        yield left_out

    def _cancel(self, number: int) -> Iterator[FromWorker]:
        for running in self._jobs:
            if running.request.id == number:
                running.job.close()
                self._jobs.remove(running)
                yield messages.Failed(number, None, "it was cancelled")
                return

    def _telling(
        self, name: str, what: str, take: Callable[[Any], Iterable[msgspec.Struct]], given: Any
    ) -> Iterator[FromWorker]:
        """Hand on what a skill tells; being busy is the skill's time, not that of whoever takes it."""
        self._begin_work(f"{name}: {what}")
        try:
            for message in take(given):
                yield messages.SkillEvent(name, pack_body(message), type(message).__name__)
        except Exception as fault:
            if name not in self._strangers:
                raise
            yield self._leave_out(name, fault)
        finally:
            self.doing = None

    def _begin_work(self, what: str) -> None:
        self.doing = (what, self._clock.now_s())


def _has_compiled() -> bool:
    """Whether a skill had to compile; one that never compiles has not loaded the compiler either."""
    compiled = sys.modules.get("chefbotd.components.worker.compiled")
    return compiled is not None and bool(compiled.has_compiled())
