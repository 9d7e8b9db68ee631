"""What the detectors make of a control loop that was held up, while its board went on."""

import pytest

from chefbotd.core.events import DutyEchoed, EncodersCounted
from chefbotd.driving.motor_watch import MotorWatch
from chefbotd.driving.wheel_reader import WheelReader
from chefbotd.motion.kinematics import ChassisParameters, Side, WheelParameters
from chefbotd.safety.faults import FaultKind
from chefbotd.safety.in_force import WrittenCommand
from chefbotd.settings import load

CYCLE_S, STEP_COUNTS, LATE_S = 0.05, 60, 0.002


class Rig:
    """A robot whose wheels never stop and whose echo always shows 120 and 90; a reading each 50 ms of board time."""

    def __init__(self, chassis: ChassisParameters | None = None) -> None:
        settings = load()
        self.wheels = chassis or settings.chassis
        self.watch = MotorWatch(settings.safety, self.wheels, settings.encoders.counts_per_turn)
        self.reader = WheelReader(self.wheels, settings.encoders, settings.same_side)
        self.cycles = 0
        self.counts = [0] * len(self.wheels.wheels)
        self.steps = [STEP_COUNTS] * len(self.counts)
        self.echo: tuple[float, ...] | None = (120.0, 90.0)

    def read(self, now_s: float, setpoint_m_s: tuple[float, ...], duty: tuple[int, ...]) -> list[FaultKind]:
        """One line of the board's is read; then this duty is sent."""
        self.watch.loop_runs(now_s)
        self.cycles += 1
        self.counts = [count + step for count, step in zip(self.counts, self.steps, strict=True)]
        event = EncodersCounted(now_s - LATE_S, now_s, self.cycles * CYCLE_S, tuple(self.counts))
        seen = self.reader.read(event, setpoint_m_s)
        self.watch.note_line(event)
        faults = [fault.kind for fault in self.watch.watch(now_s, seen, self.reader.effort)]
        echoed = None
        if self.echo is not None:
            echoed = self.watch.note_echo(DutyEchoed(now_s - 0.004, now_s, self.echo))
        self.watch.note_command(WrittenCommand(now_s, duty, (0.0,) * len(self.counts), setpoint_m_s))
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
    """1 s of late readings, then 0.25 s to hear, 36.5 mm of way at 4 mm a reading, and three readings to confirm it."""
    rig = Rig()
    now_s = rig.drive(2.0) + 3.0
    found = [(i, kind) for i in range(50) for kind in rig.read(now_s + i * CYCLE_S, (0.0, 0.0), (0, 0))]
    assert {kind for _, kind in found} <= {FaultKind.BOARD_UNRESPONSIVE, FaultKind.ECHO_MISMATCH}
    assert FaultKind.BOARD_UNRESPONSIVE in [kind for _, kind in found]
    assert min(i for i, _ in found) * CYCLE_S >= 1.0
    assert 35 <= next(i for i, kind in found if kind is FaultKind.BOARD_UNRESPONSIVE) <= 37


def stood(rig: Rig, echo: tuple[float, float] | None, seconds: float) -> float:
    """It drives for 2 s, is told to stand and does; the board shows this once, or zero each time (None). The time."""
    now_s = rig.drive(2.0)
    rig.steps = [0, 0]
    for i in range(round(seconds / CYCLE_S)):
        rig.echo = (0.0, 0.0) if echo is None else echo if i == 0 else None
        assert rig.read(now_s + i * CYCLE_S, (0.0, 0.0), (0, 0)) == []
    return now_s + seconds


@pytest.mark.parametrize(
    ("shown", "after_s", "kinds"),
    [
        (None, 2.0, set()),  # it stood, its echo said so, and somebody pushes it
        ((120.0, 90.0), 2.0, set()),  # it said once, 2 s ago, that it was driven: that is too old
        ((120.0, 0.0), 1.0, {FaultKind.BOARD_UNRESPONSIVE}),  # a second ago, and of one motor
    ],
)
def test_what_an_echo_says_of_a_robot_that_rolls_again(
    shown: tuple[float, float] | None, after_s: float, kinds: set[FaultKind]
) -> None:
    """It stands and then rolls for 0.6 s without an echo: who is to blame for that says the last one, for 1.5 s."""
    rig = Rig()
    now_s = stood(rig, shown, after_s)
    rig.steps, rig.echo = [300, 250], None
    found = [kind for i in range(12) for kind in rig.read(now_s + i * CYCLE_S, (0.0, 0.0), (0, 0))]
    assert set(found) == kinds


def test_a_motor_that_is_driven_though_zero_was_said_is_found_by_its_echo() -> None:
    """It stood for two seconds and sets off; its echo shows one motor in force that it was told before."""
    rig = Rig()
    now_s = stood(rig, None, 2.0)
    rig.steps, rig.echo = [300, 250], (120.0, 0.0)
    found = [kind for i in range(12) for kind in rig.read(now_s + i * CYCLE_S, (0.0, 0.0), (0, 0))]
    assert found == [FaultKind.BOARD_UNRESPONSIVE]


def test_a_loop_has_paused_after_more_than_a_quarter_of_a_second() -> None:
    """0.25 s is none yet."""
    watch = Rig().watch
    assert watch.loop_runs(10.0)  # the first time
    assert not watch.loop_runs(10.25)
    assert watch.loop_runs(10.53125)


@pytest.mark.parametrize(("wheels", "faults"), [(2, {FaultKind.OVERSPEED}), (3, set()), (4, set())])
def test_the_wheels_of_a_robot_with_more_than_two_may_be_dragged_along(
    wheels: int, faults: set[FaultKind]
) -> None:
    """The first, asked for 0.02 m/s, rolls at 0.27 as the others do: of two wheels only its motor can have done that."""
    sides = (Side.LEFT, Side.RIGHT, Side.LEFT, Side.RIGHT)[:wheels]
    chassis = ChassisParameters(
        track_width_m=0.3,
        wheels=tuple(
            WheelParameters(name=f"w{i}", side=side, radius_m=0.045) for i, side in enumerate(sides)
        ),
    )
    rig = Rig(chassis)
    rig.echo, rig.steps = None, [200] * wheels
    asked, duty = (0.02, *[0.27] * (wheels - 1)), (50,) * wheels
    found = {kind for i in range(40) for kind in rig.read(i * CYCLE_S, asked, duty)}
    assert found == faults


def pushed(cycle_s: float, most_s: float, steps: int, turns_round_s: float = 1e9) -> tuple[FaultKind, float]:
    """The first fault, and when, of a board whose wheels go on by ``steps`` a cycle while half of the duty drives them.

    The push turns round after each ``turns_round_s``.
    """
    settings = load()
    watch = MotorWatch(settings.safety, settings.chassis, settings.encoders.counts_per_turn)
    reader = WheelReader(settings.chassis, settings.encoders, settings.same_side)
    for cycle in range(round(most_s / cycle_s)):
        now_s, sign = cycle * cycle_s, -1 if int(cycle * cycle_s / turns_round_s) % 2 else 1
        watch.loop_runs(now_s)
        event = EncodersCounted(now_s - LATE_S, now_s, now_s, (steps * cycle,) * 2)
        watch.note_line(event)
        seen = reader.read(event, (0.2, 0.2))
        for fault in watch.watch(now_s, seen, reader.effort):
            return fault.kind, now_s
        watch.note_command(WrittenCommand(now_s, (sign * 512,) * 2, (sign * 0.5,) * 2, (sign * 0.2,) * 2))
    raise AssertionError("no fault was found")


@pytest.mark.parametrize("cycle_s", [0.005, 0.01, 0.02, 0.025, 0.034, 0.05])
def test_a_wheel_that_stands_is_found_as_late_by_readings_that_are_judged_together(cycle_s: float) -> None:
    """After 1.75 s; later by the first command's way to the board (two cycles), and by 35 ms and a cycle at most."""
    kind, found_s = pushed(cycle_s, 3.0, steps=0)
    assert kind is FaultKind.WHEEL_STALLED
    assert 1.75 <= found_s <= 1.75 + 2 * cycle_s + 0.02 + 0.035 + cycle_s


@pytest.mark.parametrize("cycle_s", [0.01, 0.05])
def test_a_wheel_that_stands_is_found_however_often_the_push_turns_round(cycle_s: float) -> None:
    """Ten changes a second: each of them costs no more than the readings in which both pushes may have been in force."""
    kind, found_s = pushed(cycle_s, 5.0, steps=0, turns_round_s=0.1)
    assert kind is FaultKind.WHEEL_STALLED
    assert found_s <= 1.75 + 0.2


@pytest.mark.parametrize("cycle_s", [0.005, 0.01, 0.02, 0.034, 0.05])
def test_a_wheel_that_is_too_fast_is_found_as_late_by_readings_that_are_judged_together(
    cycle_s: float,
) -> None:
    """0.6 m/s where 0.27 are allowed: 15 mm too far in 46 ms, 0.1 s more, two groups; the first second is free."""
    settings = load()
    radius_m = settings.chassis.wheels[0].radius_m
    counts = round(0.6 / radius_m / 6.283185307 * settings.encoders.counts_per_turn * cycle_s)
    kind, found_s = pushed(cycle_s, 2.0, steps=counts)
    assert kind is FaultKind.OVERSPEED
    assert 1.0 + 0.146 <= found_s <= 1.0 + 0.146 + 2 * (0.035 + cycle_s)
