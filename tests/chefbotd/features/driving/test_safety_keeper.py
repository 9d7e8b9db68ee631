"""The keeper of the gate: what leads from a fault back to motion."""

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import ManualClock
from chefbotd.core.events import BoardRestarted, LinkClosed, LinkOpened
from chefbotd.features.driving.motor_watch import MotorWatch
from chefbotd.features.driving.safety_keeper import SafetyKeeper
from chefbotd.process.latch_file import LatchFile
from chefbotd.safety.faults import FaultKind
from chefbotd.safety.gate import Rearm, SafetyParameters
from tests.chefbotd.features.driving.rig import CHASSIS


class Kept:
    """A keeper on a manual clock, whose link has been opened."""

    def __init__(self, rearm: Rearm = Rearm.MANUAL) -> None:
        self.clock, parameters = ManualClock(100.0), SafetyParameters(rearm=rearm)
        self.keeper = SafetyKeeper(
            Bus(),
            self.clock,
            parameters,
            wheel_names=("left", "right"),
            counts_per_turn=1000,
            mounts={},
            latch=LatchFile(None),
            motors=MotorWatch(parameters, CHASSIS),
        )
        self.keeper.on_link(LinkOpened(100.0, "dev"))

    def read(
        self, dt_s: float, travel_rad: tuple[float, ...], effort: tuple[float, ...] = (0.6, 0.4)
    ) -> None:
        """A good reading after ``dt_s``, in which the wheels were driven so."""
        self.clock.advance(dt_s)
        self.keeper.watch_wheels(self.clock.now_s(), effort, travel_rad, dt_s)

    def fault(self, *, driven: bool) -> FaultKind | None:
        """What has latched by now."""
        self.keeper.decide(self.clock.now_s(), driven=driven)
        return self.keeper._gate.fault


@pytest.mark.parametrize(("rearm", "armed"), [(Rearm.MANUAL, False), (Rearm.AUTO, True)])
def test_a_restarted_board_is_left_by_arm_or_by_itself(rearm: Rearm, armed: bool) -> None:
    """With ``rearm`` auto the fault ends in the call that tells of it; a lost link does when it is back."""
    kept = Kept(rearm)
    kept.keeper.on_link(BoardRestarted(100.5, "it said so"))
    assert kept.keeper.armed is armed
    kept.keeper.arm()
    kept.keeper.on_link(LinkClosed(101.0, "dev", "pulled"))
    assert not kept.keeper.armed
    kept.keeper.on_link(LinkOpened(102.0, "dev"))
    assert kept.keeper.armed is armed


def test_arm_forgets_a_drive_that_the_silence_interrupted() -> None:
    """Encoders fall silent while driven, an e-stop and an arm follow: the same silence, from rest, is no fault."""
    kept = Kept()
    kept.read(0.02, (0.1, 0.05))
    kept.clock.advance(0.5)
    assert kept.fault(driven=True) is None
    kept.keeper.estop("smoke")
    kept.keeper.arm()
    kept.clock.advance(2.0)
    assert kept.fault(driven=False) is None
    assert kept.keeper.armed


def test_the_same_silence_without_arm_is_a_fault() -> None:
    """After ``latch_after_s``, 2 s."""
    kept = Kept()
    kept.read(0.02, (0.1, 0.05))
    kept.clock.advance(0.5)
    assert kept.fault(driven=True) is None
    kept.clock.advance(1.6)
    assert kept.fault(driven=False) is FaultKind.ENCODERS_SILENT


def test_a_frozen_process_takes_no_wheel_for_stalled() -> None:
    """One reading after 5 s without, of wheels that were driven and have not moved, counts 0.25 s: no fault.

    Readings every 0.02 s of the same find it after 1.75 s of driving.
    """
    kept = Kept()
    kept.read(0.02, (0.1, 0.05))
    kept.read(5.0, (0.0, 0.0))
    assert kept.keeper.armed
    for _ in range(86):
        kept.read(0.02, (0.0, 0.0))
    assert not kept.keeper.armed
    assert kept.keeper._gate.fault is FaultKind.WHEEL_STALLED
