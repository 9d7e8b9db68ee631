"""The board's wheel loop alone, under a host that does not judge: a wheel that does not turn its way stops both.

The host repeats its speed 20 times a second, whatever happens: a dead encoder, one with the wrong sign, a wheel that
is held. The motor is that of ``load.py``.
"""

import math
from collections.abc import Callable

import pytest

from tests.firmware import host, load

LEFT_LOST, RIGHT_LOST = 8, 16
LOST_S = 0.25
GAINS = (load.COUNTS_PER_TURN, 50 * 256, 1300 * 256, round(load.DUTY_PER_RAD_S * 256), 0)

Encoder = Callable[[int], int]
"""What an encoder has counted, of what it should have."""


@pytest.fixture
def loop(board: host.Board) -> host.Board:
    """A board whose wheel loop is set up, in the checked mode."""
    board.hello(250)
    for parameter, value in enumerate(GAINS):
        board.seal(f"g {parameter} {value}")
    return board


def stops(board: host.Board) -> int:
    """The stops in force, by the newest state, but for the dead-man: a refused speed does not feed it."""
    return int(board.bodies("state")[-1][2]) & ~1


class Wheel:
    """The left wheel; its encoder tells the board what ``encoder`` makes of its counts."""

    def __init__(self, board: host.Board, encoder: Encoder, load_n_m: float = 0.0) -> None:
        self.board, self._encoder, self._load_n_m = board, encoder, load_n_m
        self.angle = self.speed = 0.0
        self._counted = 0

    def drive(self, mrad_s: int, seconds: float) -> float | None:
        """When full duty began, in seconds; the host repeats its command to the end."""
        full_s = None
        for step in range(round(seconds / load.STEP_S)):
            if step % 500 == 0:
                self.board.seal(f"w {mrad_s} 0")
            self.board.run_us(100)
            duty = self.board.duty[0]
            if abs(duty) == 255 and full_s is None:
                full_s = step * load.STEP_S
            self._turn(duty)
        return full_s

    def _turn(self, duty: int) -> None:
        torque = load.TORQUE_PER_DUTY * duty - load.TORQUE_PER_RAD_S * self.speed - self._load_n_m
        self.speed += torque / load.INERTIA_KG_M2 * load.STEP_S
        self.angle += self.speed * load.STEP_S
        counted = self._encoder(math.floor(self.angle / math.tau * load.COUNTS_PER_TURN))
        self.board.edges(0, counted - self._counted)
        self._counted = counted


@pytest.mark.parametrize(
    "encoder",
    [lambda count: 0, lambda count: -count, lambda count: count % 2],
    ids=["dead", "wrong sign", "one channel dead"],
)
@pytest.mark.parametrize("mrad_s", [300, 4_500, -4_500])
def test_an_encoder_that_does_not_follow_stops_the_loop(
    loop: host.Board, encoder: Encoder, mrad_s: int
) -> None:
    """The wheel is told to turn on for 2 s; it is braked 0.25 s after full duty at the latest, within 0.15 m."""
    wheel = Wheel(loop, encoder)
    full_s = wheel.drive(mrad_s, 2.0)
    assert full_s is not None
    assert loop.duty == (0, 0)
    assert stops(loop) == LEFT_LOST
    assert abs(wheel.angle) * load.RADIUS_M < 0.15
    refused = loop.seal(f"w {mrad_s} 0")
    assert loop.bodies("refused")[-1] == ["refused", "4", str(refused)]


def test_it_stops_a_quarter_of_a_second_after_full_duty(loop: host.Board) -> None:
    """To the millisecond: 250 ticks with full duty, and 0 at the next."""
    loop.seal("w 0 9000")
    while loop.duty != (0, 255):
        loop.run(0.001)
    loop.run(0.248)
    loop.seal("w 0 9000")
    loop.run(0.001)
    assert loop.duty == (0, 255)
    loop.run(0.001)
    assert loop.duty == (0, 0)
    loop.run(0.01)
    assert stops(loop) == RIGHT_LOST


@pytest.mark.parametrize("end", ["s 0 0", "arm 0"])
def test_a_stop_or_arm_ends_it(loop: host.Board, end: str) -> None:
    """As a stall; the next speed turns the wheels again."""
    Wheel(loop, lambda count: 0).drive(4_500, 1.0)
    assert stops(loop) == LEFT_LOST
    loop.seal(end)
    loop.seal("w 300 0")
    loop.run(0.011)
    assert loop.duty[0] > 0
    assert stops(loop) == 0


def test_a_reversal_at_full_duty_is_no_fault(loop: host.Board) -> None:
    """From 8 rad/s forward to 8 back at once, three times: the wheel coasts against its duty, and then follows."""
    wheel = Wheel(loop, lambda count: count)
    for mrad_s in (8_000, -8_000) * 3:
        wheel.drive(mrad_s, 1.0)
        assert wheel.speed == pytest.approx(mrad_s / 1000, abs=0.5)
        assert stops(loop) == 0


def test_a_slow_wheel_at_full_duty_is_no_fault(loop: host.Board) -> None:
    """Uphill, at a load that all but holds it: as long as it turns, it is driven."""
    wheel = Wheel(loop, lambda count: count, load_n_m=0.97 * 255 * load.TORQUE_PER_DUTY)
    assert wheel.drive(4_500, 3.0) is not None
    assert loop.duty[0] == 255
    assert 0 < wheel.speed < 1.0


def test_speeds_that_the_board_cannot_count_are_refused(board: host.Board) -> None:
    """65,535 counts a turn at 100,000 edges a second are 9.587 rad/s: beyond it `w` is out of range (3)."""
    board.hello(250)
    for parameter, value in enumerate((65_535, *GAINS[1:])):
        board.seal(f"g {parameter} {value}")
    board.forget()
    number = board.seal("w 9588 0")
    assert board.bodies("refused") == [["refused", "3", str(number)]]
    board.seal("w 9587 -9587")
    board.run(0.002)
    assert board.duty[0] > 0 > board.duty[1]
