"""The worker's thread of work: skills, requests and jobs, without a socket and on a clock that the test moves."""

from collections.abc import Iterable, Iterator

import numpy as np
import pytest

from chefbotd.clock import ManualClock
from chefbotd.components.worker import runner as runner_module
from chefbotd.components.worker.messages import (
    Answer,
    Cancel,
    Configure,
    Failed,
    FromWorker,
    Message,
    Ready,
    RequestProgress,
    SkillEvent,
    SkillRequest,
    Unavailable,
    Warming,
    make_measured,
    pack_body,
)
from chefbotd.components.worker.runner import CannotLoad, Runner
from chefbotd.components.worker.skill import Job, JobStep, Struct
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import OdometryUpdated, RangeMeasured, RangeStatus
from chefbotd.core.geometry import CERTAIN, ORIGIN, STANDING, Pose2D
from chefbotd.core.scan import LaserScan
from chefbotd.core.sentence import Sentence
from chefbotd.extras import how_to_add_extra

SCAN = make_measured(ScanMeasured(1.0, "top", ORIGIN, LaserScan(1.0, *np.zeros((3, 0)))))
ODOMETRY = make_measured(OdometryUpdated(1.0, 1.0, Pose2D(0.5), STANDING, CERTAIN))


class Counted(Message, frozen=True, tag="counted"):
    """What the counting skill tells and answers."""

    what: str
    number: int


class Counting:
    """A skill that counts what it gets; ``b"job"`` asks for three steps, ``b"no"`` is refused, all else is answered."""

    def __init__(self, clock: ManualClock) -> None:
        self._clock = clock
        self.scans = self.steps = 0
        self.is_warm = self.closed = self.undone = False

    def warm(self) -> None:
        self.is_warm = True

    def take_scan(self, scan: ScanMeasured) -> Iterable[Struct]:
        self.scans += 1
        self._clock.advance(0.002)
        yield Counted("scans", self.scans)

    def take_odometry(self, odometry: OdometryUpdated) -> Iterable[Struct]:
        return ()

    def handle(self, body: bytes) -> Struct | Job:
        if body == b"no":
            raise Refused(RefusalKind.NOT_MAPPING, Sentence("trip.not_now", "not {when}", when="now"))
        return self._job() if body == b"job" else Counted("scans", self.scans)

    def _job(self) -> Job:
        try:
            for k in range(3):
                yield JobStep(k, 3, "counting")
        except GeneratorExit:
            self.undone = True
            raise
        return Counted("job", 3)

    def step(self, now_s: float) -> Iterable[Struct]:
        self.steps += 1
        return ()

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def clock() -> ManualClock:
    """A clock that the test moves."""
    return ManualClock(100.0)


@pytest.fixture
def skill(clock: ManualClock, monkeypatch: pytest.MonkeyPatch) -> Counting:
    """The one skill that there is."""
    counting = Counting(clock)
    monkeypatch.setattr(runner_module, "load_skill", lambda name, parameters, clock: counting)
    return counting


@pytest.fixture
def runner(clock: ManualClock, skill: Counting) -> Runner:
    """A runner that has loaded the skill."""
    runner = Runner(clock)
    assert list(runner.take_message(Configure({"counting": b"{}"}))) == [Warming("counting"), Ready()]
    return runner


def test_a_skill_is_warmed_before_the_worker_is_ready(runner: Runner, skill: Counting) -> None:
    """Ready means that nothing has to be compiled any more."""
    assert skill.is_warm


def test_what_has_compiled_begins_anew_before_it_is_ready(
    clock: ManualClock, skill: Counting, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A compiler's memory does not stay with the worker; with everything in the cache there is nothing to be rid of."""
    begun: list[Configure] = []

    class Anew(Exception):
        pass

    def renew(configure: Configure) -> None:
        begun.append(configure)
        raise Anew

    configure = Configure({"counting": b"{}"})
    monkeypatch.setattr(runner_module, "_has_compiled", lambda: True)
    told: list[FromWorker] = []
    with pytest.raises(Anew):
        told.extend(Runner(clock, renew).take_message(configure))
    assert begun == [configure]
    assert Ready() not in told
    assert Ready() in list(Runner(clock).take_message(configure)), "it has begun anew already"
    monkeypatch.setattr(runner_module, "_has_compiled", lambda: False)
    assert Ready() in list(Runner(clock, renew).take_message(configure))


def test_measurements_reach_the_skill_and_what_it_tells_is_sent(runner: Runner) -> None:
    """A scan's consequences leave in the order in which the skill tells them."""
    assert list(runner.take_message(ODOMETRY)) == []
    assert list(runner.take_message(SCAN)) == [
        SkillEvent("counting", pack_body(Counted("scans", 1)), "Counted")
    ]
    assert list(runner.take_message(SCAN)) == [
        SkillEvent("counting", pack_body(Counted("scans", 2)), "Counted")
    ]


class Listening(Counting):
    """One that wants echoes too."""

    def take_range(self, measured: RangeMeasured) -> Iterable[Struct]:
        self.ranges = [*getattr(self, "ranges", []), measured.range_m]
        return ()


def test_an_echo_reaches_the_skills_that_want_echoes_and_no_other(
    runner: Runner, skill: Counting, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a counting skill and a listening one the second hears it."""
    listening = Listening(clock)
    echo = make_measured(RangeMeasured(1.0, 1.0, "front", RangeStatus.OK, 0.65, 0.02, 4.0, 0.26))
    assert list(runner.take_message(echo)) == []
    monkeypatch.setattr(runner_module, "load_skill", lambda name, parameters, clock: listening)
    list(runner.take_message(Configure({"listening": b"{}"})))
    assert list(runner.take_message(echo)) == []
    assert listening.ranges == [0.65]


def test_a_request_is_answered_or_refused(runner: Runner) -> None:
    """At once where it takes no time; an unknown skill is refused too."""
    assert list(runner.take_message(SkillRequest(1, "counting", 5.0, b""))) == [
        Answer(1, pack_body(Counted("scans", 0)))
    ]
    assert list(runner.take_message(SkillRequest(2, "counting", 5.0, b"no"))) == [
        Failed(2, RefusalKind.NOT_MAPPING, "not now", {"id": "trip.not_now", "arguments": {"when": "now"}})
    ]
    (failed,) = runner.take_message(SkillRequest(3, "cooking", 5.0, b""))
    assert isinstance(failed, Failed)
    assert "'cooking'" in failed.message


def test_a_job_goes_on_between_scans(runner: Runner) -> None:
    """Each turn is one step of it; scans are taken in between; its end is the answer."""
    assert list(runner.take_message(SkillRequest(5, "counting", 5.0, b"job"))) == []
    sent: list[FromWorker] = []
    for _ in range(4):
        assert runner.wait_s == 0.0
        sent += runner.take_turn()
        sent += runner.take_message(SCAN)
    assert [m for m in sent if not isinstance(m, SkillEvent)] == [
        *(RequestProgress(5, k, 3, "counting") for k in range(3)),
        Answer(5, pack_body(Counted("job", 3))),
    ]
    assert runner.wait_s > 0.0


def test_a_job_can_be_given_up(runner: Runner, skill: Counting) -> None:
    """It is closed at a step, so that it can put things as they were, and is answered; another id concerns nobody."""
    list(runner.take_message(SkillRequest(5, "counting", 5.0, b"job")))
    list(runner.take_turn())
    assert list(runner.take_message(Cancel(4))) == []
    assert list(runner.take_message(Cancel(5))) == [Failed(5, None, "it was cancelled")]
    assert skill.undone
    assert list(runner.take_turn()) == []


def test_what_it_does_is_visible_while_it_does_it(runner: Runner, clock: ManualClock) -> None:
    """The other thread reads at what the worker is and since when; idle is None."""
    telling: Iterator[FromWorker] = runner.take_message(SCAN)
    assert runner.doing is None
    next(telling)
    assert runner.doing == ("counting: a scan", pytest.approx(clock.now_s() - 0.002))
    assert list(telling) == []
    assert runner.doing is None


def test_skills_have_their_own_time(runner: Runner, skill: Counting, clock: ManualClock) -> None:
    """Twenty times a second, however many messages come, and also after a turn that came late."""
    for late_s in (0.0, 0.02):
        before = skill.steps
        for _ in range(100):
            list(runner.take_turn())
            clock.advance(0.01)
        assert 19 <= skill.steps - before <= 21
        assert 0.0 <= runner.wait_s <= 0.05
        clock.advance(late_s)


def test_the_end_reaches_skills_and_jobs(runner: Runner, skill: Counting) -> None:
    """Jobs are given up and skills may save."""
    list(runner.take_message(SkillRequest(5, "counting", 5.0, b"job")))
    list(runner.take_turn())
    runner.close()
    assert skill.undone
    assert skill.closed


def test_a_missing_extra_is_one_clear_sentence(monkeypatch: pytest.MonkeyPatch, clock: ManualClock) -> None:
    """Without numba the worker says which extra to install, and is not ready."""

    def without_numba(name: str) -> object:
        raise ModuleNotFoundError("No module named 'numba'", name="numba")

    monkeypatch.setattr(runner_module, "import_module", without_numba)
    told = f"mapping needs numba, which is not installed: {how_to_add_extra('navigation')}"
    with pytest.raises(CannotLoad, match="pip install"):
        runner_module.load_skill("mapping", b"{}", ManualClock())
    assert list(Runner(clock).take_message(Configure({"mapping": b"{}"}))) == [
        Warming("mapping"),
        Unavailable(told),
    ]


def test_a_fault_of_our_own_is_not_taken_for_a_missing_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    """A module of chefbotd that is not there is a bug, and raises."""

    def broken(name: str) -> object:
        raise ModuleNotFoundError("No module named 'chefbotd.nowhere'", name="chefbotd.nowhere")

    monkeypatch.setattr(runner_module, "import_module", broken)
    with pytest.raises(ModuleNotFoundError):
        runner_module.load_skill("mapping", b"{}", ManualClock())
