"""The detector of a line on which no command arrives."""

import pytest

from chefbotd.safety.commands_lost import LOST_S, BoardSays, watch
from chefbotd.safety.faults import Fault, FaultKind

CYCLE_S = 0.01
STOPPED, OBEYS = BoardSays(dead_man=True, damaged=70, refused=3), BoardSays()


def run(pattern: list[tuple[BoardSays, bool]]) -> tuple[float, list[Fault]]:
    """The board says these, a reading each, and the robot is driven or not: after which time what was told."""
    lost_s, found, first_s = 0.0, [], 0.0
    for index, (says, driven) in enumerate(pattern):
        lost_s, fault = watch(lost_s, says, CYCLE_S, driven=driven)
        if fault is not None:
            first_s = first_s or (index + 1) * CYCLE_S
            found.append(fault)
    return first_s, found


def test_a_second_of_driving_in_vain_is_the_lines_fault() -> None:
    """It is told with the reading that completes the second, and names the cable and what the board counted."""
    first_s, (fault,) = run([(STOPPED, True)] * 101)
    assert first_s == pytest.approx(LOST_S)
    assert fault.kind is FaultKind.COMMANDS_LOST
    assert "70 damaged lines and 3 that it refused" in fault.reason
    assert "cable" in fault.reason


def test_a_robot_that_is_not_driven_may_be_stopped_by_its_board_for_ever() -> None:
    """At rest the dead-man is in force."""
    assert run([(STOPPED, False)] * 100_000) == (0.0, [])


def test_a_line_that_loses_half_of_the_commands_drives_on() -> None:
    """As much time in which commands arrive as in which none does: 0.3 s each, a thousand times."""
    assert run(([(STOPPED, True)] * 30 + [(OBEYS, True)] * 30) * 1000) == (0.0, [])


def test_one_command_that_arrives_ends_nothing() -> None:
    """One reading in eleven shows that one arrived: 0.09 s more lost in each 0.11 s, so 1.0 s after 1.21 s."""
    first_s, found = run(([(STOPPED, True)] * 10 + [(OBEYS, True)]) * 12)
    assert [fault.kind for fault in found] == [FaultKind.COMMANDS_LOST]
    assert first_s == pytest.approx(1.21, abs=0.02)


def test_short_drives_add_up_to_nothing() -> None:
    """A thousand taps of 40 ms: the first command arrives after 30 ms, and the dead-man comes 250 ms after the last."""
    tap = [(STOPPED, True)] * 3 + [(OBEYS, True)] + [(OBEYS, False)] * 25 + [(STOPPED, False)] * 20
    assert run(tap * 1000) == (0.0, [])
