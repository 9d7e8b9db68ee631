"""Every short sequence of what two or three clients can do: whoever a stop holds moves nothing, and nobody else is held.

The methods, the leases and the gate are the real ones, on a clock that stands still between two deeds.
"""

import random
from collections.abc import Iterable, Iterator
from itertools import product
from types import SimpleNamespace
from typing import Any, cast

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import ManualClock
from chefbotd.core.commands import Allowed, RefusalKind, Refused
from chefbotd.core.events import LinkOpened
from chefbotd.core.geometry import Motion, Pose2D, Twist2D
from chefbotd.driving.commands import DriveCommands
from chefbotd.driving.inner_driver import InnerDriver
from chefbotd.driving.models import (
    ArmParams,
    DriveParams,
    EstopParams,
    SetWheelVelocitiesParams,
    StopParams,
)
from chefbotd.driving.motor_watch import MotorWatch
from chefbotd.driving.safety_supervisor import SafetySupervisor
from chefbotd.driving.service import DriveService
from chefbotd.driving.wheel_reader import WheelReader
from chefbotd.motion.drive import Drive
from chefbotd.motion.drive_state import DriveParameters
from chefbotd.motion.encoder import EncoderParameters
from chefbotd.motion.same_side import SameSideParameters
from chefbotd.process.latch_file import LatchFile
from chefbotd.rpc.control_leases import ControlLeases, Sources
from chefbotd.rpc.method import Unserved, methods_of
from chefbotd.rpc.methods import ServerMethods
from chefbotd.rpc.models import NoParams, TakeControlParams
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.rpc.session import Session
from chefbotd.safety import gate
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.gate import SafetyParameters
from chefbotd.safety.watchdog import ControlParameters, WatchdogParameters
from tests.chefbotd.driving.rig import CHASSIS, GAINS, LIMITS
from tests.chefbotd.driving.stop_rule import PAUSE_S, TAKING_PAUSE_S, Deed, is_held

DEED_S = 0.1
FAULT = Fault(FaultKind.WHEEL_STALLED, "left_wheel is driven and does not turn")
GAPS_S = {"wait a little": 0.4, "wait long": 1.1, "wait for a taking": 5.1}
DEEDS = ("drive", "stop", "estop", "arm", "take", "release", "reconnect")
MORE_DEEDS = (*DEEDS, "drive", "drive", "drive", "zero", "wheels", "navigation", "arm")
DRIVE = Drive(DriveParameters(max_rim_speed_m_s=0.5, max_duty=1023), CHASSIS, LIMITS, (GAINS, GAINS))
SAFETY, API, ENCODERS = (
    SafetyParameters(),
    ApiParameters(),
    EncoderParameters(counts_per_turn=1000, max_speed_rad_s=20.0),
)
TRIES = ("drive", "zero", "wheels", "navigation")
Step = tuple[str, str]


class Motionless(DriveService):
    """Takes commands as ever, and steps no wheel for them."""

    def _obey(self, now_s: float) -> None:
        """There is no board."""

    def renew_command(self, source: str, motion: Motion, client: int) -> bool:
        """As a robot would that drives, and has just decided what to follow."""
        now_s, keeper = self._clock.now_s(), self.keeper
        keeper.own_state.decision = gate.decide(SAFETY, keeper.gate, now_s)
        return keeper.renew_command(gate.Command(source, motion, now_s), client)


class Robot:
    """The part of a daemon that moves or stops, its clients, and what they have done so far."""

    def __init__(self) -> None:
        bus, self.clock, parameters = Bus(), ManualClock(100.0), SAFETY
        self.service = Motionless(
            bus,
            self.clock,
            lambda duty: None,
            DRIVE,
            SafetySupervisor(
                bus,
                self.clock,
                parameters,
                mounts={"front": Pose2D(0.15)},
                latch=LatchFile(None),
                motors=MotorWatch(parameters, CHASSIS, 1000),
            ),
            reader=WheelReader(CHASSIS, ENCODERS, SameSideParameters()),
            wheel_names=tuple(wheel.name for wheel in CHASSIS.wheels),
            control=ControlParameters(),
            watchdog=WatchdogParameters(),
        )
        bus.publish(LinkOpened(100.0, "board"))
        preview = SimpleNamespace(of_twist=Allowed, of_wheels=lambda wanted: Allowed({"left_wheel": 1.0}))
        self.leases = ControlLeases(3.0, 1.0, self.service.release, lambda event: None)
        sources = tuple(parameters.sources)
        self.driving = DriveCommands(
            self.service,
            cast("Any", preview),
            self.leases,
            self.clock,
            sources=sources,
            default_source="teleop",
        )
        taking = Sources(sources, "teleop", self.service.take_over)
        self.server = ServerMethods({}, cast("Any", None), self.clock, self.leases, taking)
        self.own = InnerDriver(self.service, self.leases, self.clock, "navigation")
        renew = next(row.renew for row in methods_of(self.driving) if row.name == "drive")
        assert renew is not None
        self.renew_drive, self.renewed = renew, 0
        self.deeds: list[Deed] = []
        self.moved_since_latch: list[str] = []
        self._connections = 0
        self._taken_s = float("-inf")
        self._callers: dict[str, Any] = {}

    def do(self, who: str, what: str) -> None:
        """One step; checks that a drive moves the robot just where the rule lets it."""
        self.clock.advance(GAPS_S.get(what, DEED_S))
        if what in GAPS_S:
            return
        now_s, latched = self.clock.now_s(), not self.service.keeper.armed
        if what == "fault":
            self.service.fail(FAULT)
            self.moved_since_latch.clear()
            if not latched:
                self.deeds.append(Deed(now_s, -1, "fault"))
            return
        caller = self._caller(who)
        number = caller.session.number
        result = problem = None
        try:
            result = self._own(what) if who == "own" else self._call(caller, what)
        except (Refused, Unserved) as refusal:
            problem = refusal
        if what in TRIES:
            source = "navigation" if what == "navigation" else "teleop"
            held = latched or is_held(tuple(self.deeds), number, source, now_s)
            self.deeds.append(Deed(now_s, number, "try", source, latched))
            assert not (held and problem is None), "it moved, though a stop holds it"
            self.moved_since_latch += [who] if problem is None else []
            stopped = isinstance(problem, Refused) and problem.kind is RefusalKind.STOPPED
            assert held or not stopped, "it was refused, though no stop holds it"
        elif problem is None:
            self._note(what, number, now_s, result, latched=latched)

    def _note(self, what: str, number: int, now_s: float, result: Any, *, latched: bool) -> None:
        if what in ("stop", "estop"):
            self.deeds.append(Deed(now_s, number, what))
            self.moved_since_latch.clear()
        elif what == "arm":
            self.deeds.append(Deed(now_s, number, "ask"))
        elif what == "take":
            tries = [deed for deed in self.deeds if (deed.what, deed.client) == ("try", number)]
            is_anew = not any(deed.source == "teleop" and now_s - deed.at_s < PAUSE_S for deed in tries)
            is_anew = is_anew and now_s - self._taken_s >= TAKING_PAUSE_S
            self._taken_s = now_s
            if result.taken_from is not None and is_anew and not latched:
                self.deeds.append(Deed(now_s, number, "ask", "teleop"))
            self.deeds.append(Deed(now_s, number, "try", "teleop", latched))
        elif what == "goal":
            self.deeds.append(Deed(now_s, number, "ask", "navigation"))

    def _caller(self, who: str) -> Any:
        if who == "own":
            return SimpleNamespace(session=self.own._session)
        if who not in self._callers:
            self._connections += 1
            session = Session(API, "10.0.0.7", self._connections, Role.DRIVE, 0.0)
            session.number = self._connections
            self._callers[who] = SimpleNamespace(session=session, said=None)
        return self._callers[who]

    def _own(self, what: str) -> None:
        if what == "goal":
            self.own.begin(self.own.stop_number, "this was asked for")
        elif what == "navigation":
            self.own.drive(Twist2D(0.1, 0.0), self.clock.now_s())

    def _call(self, caller: Any, what: str) -> Any:
        driving, forward = self.driving, 0.0 if what == "zero" else 0.2
        if what in ("drive", "zero"):
            return self._drive(caller, DriveParams(linear_m_s=forward, angular_rad_s=0.0))
        if what == "navigation":
            return self._drive(caller, DriveParams(linear_m_s=0.1, angular_rad_s=0.0, source="navigation"))
        if what == "wheels":
            return driving.set_wheel_velocities(
                caller, SetWheelVelocitiesParams(name=["left_wheel"], velocity_rad_s=[1.0])
            )
        if what == "stop":
            return driving.stop(caller, StopParams())
        if what == "estop":
            return driving.estop(caller, EstopParams())
        if what == "arm":
            return driving.arm(caller, ArmParams(latch=None))
        if what == "take":
            return self.server.take_control(caller, TakeControlParams(source=None))
        if what == "release":
            return self.server.release_control(caller, NoParams())
        self.leases.release(caller.session, self.clock.now_s())
        self._callers = {name: each for name, each in self._callers.items() if each is not caller}
        return None

    def _drive(self, caller: Any, params: DriveParams) -> Any:
        """As the socket does: who says what it said last renews that where it can."""
        says_the_same, caller.said = params == caller.said, params
        renewed = self.renew_drive(caller, params) if says_the_same else None
        self.renewed += renewed is not None
        return renewed or self.driving.drive(caller, params)


def check(sequences: Iterable[tuple[Step, ...]]) -> int:
    """Whoever a stop holds moves nothing, nobody is refused whom none holds; returns how many drives were renewals."""
    renewed = 0
    for steps in sequences:
        robot, done = Robot(), 0
        try:
            for step in steps:
                done += 1
                robot.do(*step)
        except AssertionError as failure:
            raise AssertionError(f"{failure}: {', '.join(' '.join(step) for step in steps[:done])}") from None
        renewed += robot.renewed
    return renewed


def every(clients: str, between: int) -> Iterator[tuple[Step, ...]]:
    """Ann drives, then so many steps of all that these clients can do, or a wait; then each of them drives."""
    steps = [*product(clients, DEEDS), ("robot", "fault"), *(("all", gap) for gap in GAPS_S)]
    for chosen in product(steps, repeat=between):
        for last in clients:
            yield (("a", "drive"), *chosen, (last, "drive"))


def some(number: int) -> Iterator[tuple[Step, ...]]:
    """Random sequences of three clients and navigation."""
    choose = random.Random(20)
    steps = [*product("abc", MORE_DEEDS), ("own", "navigation"), ("own", "goal"), ("robot", "fault")]
    steps += [("all", "wait a little")] * 2 + [("all", "wait long"), ("all", "wait for a taking")]
    for _ in range(number):
        yield tuple(choose.choices(steps, k=25))


@pytest.mark.parametrize(
    "sequences",
    [
        every("ab", 2),
        pytest.param(every("ab", 4), marks=pytest.mark.slow),
        pytest.param(every("abc", 3), marks=pytest.mark.slow),
    ],
    ids=["two clients", "two clients, longer", "three clients"],
)
def test_whoever_a_stop_holds_moves_nothing(sequences: Iterator[tuple[Step, ...]]) -> None:
    """Every sequence of drives, stops, faults, arms, takeovers, reconnects and waits; some drives are renewals."""
    assert check(sequences) > 50


@pytest.mark.parametrize("number", [100, pytest.param(30_000, marks=pytest.mark.slow)])
def test_long_sequences_of_everything_keep_the_rule(number: int) -> None:
    """Also with zeros, wheels, a second source and navigation's own goals."""
    assert check(some(number)) > 20


@pytest.mark.parametrize("latch", [("c", "estop"), ("c", "stop"), ("robot", "fault")])
@pytest.mark.parametrize("is_anew", [False, True])
@pytest.mark.parametrize("drives", [1, 6])
def test_two_programs_that_repeat_taking_control_and_driving_do_not_move_after_a_stop(
    latch: Step, drives: int, *, is_anew: bool
) -> None:
    """On one connection, or on a new one each time, which drives once or for 3 s; who arms after it drives at once."""
    driving = [("all", "wait a little"), None] * (drives - 1)
    one_each: list[Step] = []
    for who in "ab":
        one_each += [(who, "reconnect")] if is_anew else []
        one_each += [(who, "take"), (who, "drive"), *[step or (who, "drive") for step in driving]]
    robot = Robot()
    for step in (*one_each, latch, *one_each, ("c", "arm"), *one_each * (9 if drives == 1 else 2)):
        robot.do(*step)
    assert robot.moved_since_latch == []
    robot.do("d", "take")
    robot.do("d", "drive")
    assert robot.moved_since_latch == []
    robot.do("d", "arm")
    robot.do("d", "take")
    robot.do("d", "drive")
    assert robot.moved_since_latch == ["d"]


@pytest.mark.parametrize("latch", [("c", "estop"), ("robot", "fault")])
def test_what_was_taken_over_during_a_latch_counts_for_nothing_after_it(latch: Step) -> None:
    """Who takes over after it from a driver that repeats, once, drives at once."""
    early = Robot()
    for step in (("a", "drive"), latch, ("d", "take"), ("c", "arm"), ("d", "drive")):
        early.do(*step)
    assert early.moved_since_latch == []

    later = Robot()
    for step in (
        ("a", "drive"),
        latch,
        ("a", "drive"),
        ("c", "arm"),
        ("a", "drive"),
        ("d", "take"),
        ("d", "drive"),
    ):
        later.do(*step)
    assert later.moved_since_latch == ["d"]


@pytest.mark.parametrize("latch", [("b", "estop"), ("robot", "fault")])
def test_what_was_asked_before_an_estop_or_a_fault_and_another_clients_arm_moves_nothing(latch: Step) -> None:
    """Then Bob's drive of zero and arm, while Ann repeats: she is held, on one connection or on many."""
    bob = (latch, ("a", "drive"), ("b", "zero"), ("b", "arm"))
    held: tuple[Step, ...] = (("a", "drive"), ("a", "reconnect")) * 9
    check([(*bob, *held), (("a", "drive"), *bob, *held), (("a", "drive"), ("a", "reconnect"), *bob, *held)])
