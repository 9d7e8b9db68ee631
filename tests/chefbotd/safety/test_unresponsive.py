"""A robot that moves though it was told to stand, and one that somebody pushes."""

from collections.abc import Callable

import pytest

from chefbotd.safety import unresponsive
from chefbotd.safety.faults import Fault, FaultKind
from chefbotd.safety.unresponsive import DRIVEN, UnresponsiveParameters, UnresponsiveState

P = UnresponsiveParameters()


class Board:
    """Sends a reading every ``cycle_s``; zero was said at 3 s."""

    def __init__(self, cycle_s: float = 0.05) -> None:
        self.cycle_s, self.now_s = cycle_s, 3.0
        self.state: UnresponsiveState = unresponsive.record_command(DRIVEN, 3.0, driven=False)
        self.faults: list[tuple[float, Fault]] = []

    def go(
        self, seconds: float, speed: Callable[[float], float], *, echoes_motion: bool = False
    ) -> list[tuple[float, Fault]]:
        """The left rim at this speed, a function of the seconds since; the right one goes back half as fast."""
        began_s = self.now_s
        for _ in range(round(seconds / self.cycle_s)):
            self.now_s += self.cycle_s
            speed_m_s = speed(self.now_s - began_s)
            self.state = unresponsive.record_command(self.state, self.now_s, driven=False)
            travel_m = (speed_m_s * self.cycle_s, -0.5 * speed_m_s * self.cycle_s)
            self.state, fault = unresponsive.watch(
                P,
                self.state,
                self.now_s,
                travel_m,
                (speed_m_s, -0.5 * speed_m_s),
                self.cycle_s,
                echoes_motion=echoes_motion,
            )
            if fault is not None:
                self.faults.append((self.now_s - 3.0, fault))
        return self.faults


@pytest.mark.parametrize("cycle_s", [0.004, 0.02, 0.05])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_board_that_drives_on_is_found_once(cycle_s: float, way: float) -> None:
    """0.25 s to hear, then 0.295^2 = 87 mm of coasting and 30 mm of slack take 0.4 s: well within a second."""
    ((found_s, fault),) = Board(cycle_s).go(6.0, lambda _: 0.295 * way)
    assert 0.6 <= found_s <= 0.85
    assert fault.kind is FaultKind.BOARD_UNRESPONSIVE
    assert "0.29 m/s" in fault.reason or "0.30 m/s" in fault.reason
    assert "Cut the motors' power" in fault.reason


@pytest.mark.parametrize("cycle_s", [0.004, 0.05])
@pytest.mark.parametrize("braking_m_s2", [0.5, 2.0])
def test_a_robot_that_coasts_is_no_fault(cycle_s: float, braking_m_s2: float) -> None:
    """From 0.34 m/s, for 0.2 s as before, then slower by 0.5 m/s2."""

    def speed(t: float) -> float:
        return max(0.0, 0.34 - braking_m_s2 * max(0.0, t - 0.2))

    assert Board(cycle_s).go(5.0, speed) == []


def test_a_stop_that_waits_for_an_echo_is_no_fault() -> None:
    """The sketch stands still for 1.1 s, drives on meanwhile, and shows it with one reading; then it brakes."""
    board = Board(cycle_s=1.1)
    board.go(1.1, lambda _: 0.3)
    board.cycle_s = 0.05
    assert board.go(3.0, lambda t: 0.3 if t < 0.06 else max(0.0, 0.2 - t)) == []


def test_a_robot_that_is_pushed_after_it_stood_is_no_fault() -> None:
    """It stood for half a second, then somebody rolls it two metres away; its board says that nothing is driven."""
    board = Board()
    board.go(0.5, lambda _: 0.0)
    assert board.go(5.0, lambda _: 0.4) == []


def test_a_robot_that_sets_off_by_itself_is_found_by_its_echo() -> None:
    """It stood, and then moves while its echo says that a motor is driven."""
    board = Board()
    board.go(2.0, lambda _: 0.0)
    ((found_s, fault),) = board.go(3.0, lambda _: 0.2, echoes_motion=True)
    assert found_s <= 2.5
    assert "its echo shows a duty other than zero" in fault.reason


def test_one_damaged_echo_does_not_accuse_who_pushes() -> None:
    """While it is pushed, every fourth echo shows a motor that is driven."""
    board = Board()
    board.go(0.5, lambda _: 0.0)
    for turn in range(100):
        board.go(0.05, lambda _: 0.3, echoes_motion=turn % 4 == 0)
    assert board.faults == []


def test_a_command_ends_the_suspicion() -> None:
    """Any duty begins anew, and so does the next zero."""
    board = Board()
    board.go(0.5, lambda _: 0.295)
    board.state = unresponsive.record_command(board.state, board.now_s, driven=True)
    assert board.state == DRIVEN
    assert board.go(0.5, lambda _: 0.295) == []


def test_a_moment_at_rest_is_no_rest() -> None:
    """Two readings of zero, 0.1 s, in the middle of a drive that goes on: it has not stood for 0.2 s."""
    board = Board()
    board.go(0.3, lambda _: 0.295)
    board.go(0.1, lambda _: 0.0)
    ((_, fault),) = board.go(1.5, lambda _: 0.295)
    assert fault.kind is FaultKind.BOARD_UNRESPONSIVE


def test_what_just_reaches_the_way_that_it_may_coast_is_no_fault() -> None:
    """Heard at 0.25 s at 0.25 m/s: 62.5 mm and 31.25 mm of slack, which three readings of 31.25 mm are, and no more."""
    params = UnresponsiveParameters(tolerance_m=0.03125)
    state = unresponsive.record_command(DRIVEN, 0.0, driven=False)
    for reading in range(3):
        state, _ = unresponsive.watch(
            params, state, 0.125 * reading + 0.125, (0.0, 0.0), (0.25, -0.1), 0.125, echoes_motion=False
        )
    for reading, travel_m in enumerate((0.03125, 0.03125, 0.03125, 0.0, 0.0, 0.0)):
        now_s = 0.5 + 0.125 * reading
        state, fault = unresponsive.watch(
            params, state, now_s, (travel_m, 0.0), (0.25, 0.0), 0.125, echoes_motion=False
        )
        assert fault is None
        assert state.beyond == 0
