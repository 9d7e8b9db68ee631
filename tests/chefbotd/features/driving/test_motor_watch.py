"""What the detectors make of a control loop that was held up, while its board went on."""

import pytest

from chefbotd.core.events import DutyEchoed, EncodersCounted
from chefbotd.features.driving.motor_watch import MotorWatch
from chefbotd.features.driving.wheel_reader import WheelReader
from chefbotd.safety.faults import FaultKind
from chefbotd.settings import load

CYCLE_S, STEP_COUNTS = 0.05, 60


class Rig:
    """A robot whose wheels never stop and whose echo always shows 120 and 90; a reading each 50 ms of board time."""

    def __init__(self) -> None:
        settings = load()
        self.watch = MotorWatch(settings.safety, settings.chassis)
        self.reader = WheelReader(settings.chassis, settings.encoders, settings.same_side)
        self.cycles = 0

    def read(self, now_s: float, setpoint_m_s: tuple[float, float], duty: tuple[int, int]) -> list[FaultKind]:
        """One line of the board's is read; then this duty is sent."""
        self.watch.loop_runs(now_s)
        self.cycles += 1
        counts = (self.cycles * STEP_COUNTS, self.cycles * STEP_COUNTS)
        event = EncodersCounted(now_s, now_s, self.cycles * CYCLE_S, counts)
        seen = self.reader.read(event, setpoint_m_s)
        faults = [fault.kind for fault in self.watch.watch(now_s, setpoint_m_s, seen)]
        echoed = self.watch.hear(DutyEchoed(now_s - 0.004, now_s, (120.0, 90.0)))
        self.watch.tell(now_s, duty)
        return faults if echoed is None else [*faults, echoed.kind]

    def drive(self, seconds: float) -> float:
        """As it is asked to, from 0 s on; the time then."""
        cycles = round(seconds / CYCLE_S)
        for i in range(cycles):
            assert self.read(i * CYCLE_S, (0.2, 0.19), (120, 90)) == []
        return cycles * CYCLE_S


@pytest.mark.parametrize("paused_s", [1.0, 5.0])
def test_what_waited_on_the_line_while_the_loop_stood_still_is_no_fault(paused_s: float) -> None:
    """A pause in mid-drive, then a stop: lines of the pause come at once and show motion; after them it stands."""
    rig = Rig()
    now_s = rig.drive(2.0) + paused_s
    for i in range(round(paused_s / CYCLE_S)):
        assert rig.read(now_s + i * 0.005, (0.0, 0.0) if i > 5 else (0.02, 0.01), (0, 0)) == []


def test_a_board_that_is_deaf_after_a_pause_is_found_later() -> None:
    """It drives on for 1 s of late readings, and 1.5 s more at most."""
    rig = Rig()
    now_s = rig.drive(2.0) + 3.0
    found = [(i, kind) for i in range(50) for kind in rig.read(now_s + i * CYCLE_S, (0.0, 0.0), (0, 0))]
    assert {kind for _, kind in found} <= {FaultKind.BOARD_DEAF, FaultKind.ECHO_MISMATCH}
    assert FaultKind.BOARD_DEAF in [kind for _, kind in found]
    assert min(i for i, _ in found) * CYCLE_S >= 1.0
