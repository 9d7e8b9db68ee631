"""Which commands the board can have obeyed while a reading was taken."""

import random

import pytest

from chefbotd.safety.in_force import Envelope, InForce, WrittenCommand

CYCLE_S = 0.05


def command(since_s: float, duty: int, setpoint_m_s: float | None = None) -> WrittenCommand:
    """The same for both wheels: this duty, of 200 in all, for a speed of a thousandth of it unless told another."""
    speed_m_s = duty / 1000 if setpoint_m_s is None else setpoint_m_s
    return WrittenCommand(since_s, (duty, duty), (duty / 200,) * 2, (speed_m_s,) * 2)


class Board:
    """A board that reads when a cycle begins, and obeys at its end; ``at_once``: whenever a command comes."""

    def __init__(self, *, at_once: bool = False, echoes: bool = False) -> None:
        self.in_force, self.at_once, self.echoes = InForce(), at_once, echoes
        self.read = self.obeyed = command(0.0, 0)
        self.in_force.note_command(self.read)
        self.now_s, self.over = 0.0, [self.obeyed]

    def hear(self, heard: WrittenCommand) -> None:
        """A command is written now."""
        self.in_force.note_command(heard)
        if self.at_once:
            self.over.append(heard)
            self.obeyed = heard

    def cycle(
        self, began_s: float, switches_s: float, heard: list[WrittenCommand]
    ) -> tuple[Envelope | None, list[WrittenCommand]]:
        """Encoders at ``began_s``, the command that was read in force at ``switches_s``: what can have been, and was."""
        line = self.in_force
        line.note_line(began_s, began_s + 0.003, has_clock=True)
        envelope, truth = line.over_reading(), self.over
        self.over = [self.obeyed]
        reads = line.commands[0]
        for each in heard:
            if each.since_s >= switches_s:
                break
            self.hear(each)
        if not self.at_once:
            self.obeyed = reads
            self.over.append(reads)
        if self.echoes:
            line.note_echo(switches_s, tuple(map(float, self.obeyed.duty)))
        for each in heard:
            if each.since_s >= switches_s:
                self.hear(each)
        return envelope, truth


def drawn(seed: int, board: Board) -> None:
    """Two hundred cycles, a third of them silent for a second, and commands at any time; checks each envelope."""
    chance = random.Random(seed)
    began_s = 1.0
    for _ in range(200):
        wait_s = 1.0 if chance.random() < 0.3 else 0.02
        ends_s = began_s + wait_s + 0.03
        times = sorted(chance.uniform(began_s, ends_s) for _ in range(chance.choice((0, 1, 2, 7))))
        heard = [command(at_s, chance.choice((-160, -40, 0, 40, 160))) for at_s in times]
        envelope, truth = board.cycle(began_s, began_s + wait_s, heard)
        began_s = ends_s
        if envelope is None:
            continue
        asked_m_s, effort = envelope.asked_m_s[0], envelope.effort[0]
        assert abs(asked_m_s) >= max(abs(each.setpoint_m_s[0]) for each in truth)
        assert abs(effort) <= min(abs(each.effort[0]) for each in truth)
        if effort and min(each.effort[0] for each in truth) < 0 < max(each.effort[0] for each in truth):
            assert envelope.may_turn_round == (True, True)


@pytest.mark.parametrize("echoes", [False, True])
@pytest.mark.parametrize("at_once", [False, True])
def test_what_was_in_force_is_never_missed(at_once: bool, echoes: bool) -> None:
    """Of 50 boards each, silent or not, with an echo and without: no speed that was asked for, and no direction."""
    for seed in range(50):
        board = Board(at_once=at_once, echoes=echoes)
        board.in_force.acts_at_once = at_once
        drawn(seed, board)


def test_a_steady_command_is_all_that_can_be_in_force() -> None:
    """After three cycles of 50 ms nothing else is possible."""
    board = Board()
    board.hear(command(1.0, 100))
    seen = [board.cycle(1.01 + i * CYCLE_S, 1.03 + i * CYCLE_S, [])[0] for i in range(5)]
    assert seen[1:] == [
        Envelope((0.0, 0.0), (), (0.1, 0.1), is_steady=False),  # read 1.01, in force from 1.03 s on
        Envelope(
            (0.0, 0.0), (), (0.1, 0.1), is_steady=False
        ),  # the wire may have taken until the second cycle
        Envelope((0.5, 0.5), (), (0.1, 0.1)),
        Envelope((0.5, 0.5), (), (0.1, 0.1)),
    ]


def test_the_command_of_two_silent_seconds_ago_may_be_in_force() -> None:
    """0.3 m/s is read at 2 s and in force from 3 s to 4.1 s; zero was written at 2.3 s. A reading at 4.1 s shows 0.3."""
    board = Board()
    board.cycle(1.0, 1.02, [])
    board.cycle(1.05, 1.07, [command(1.1, 200, 0.3)])
    board.cycle(2.0, 3.0, [command(2.3, 0)])
    envelope, truth = board.cycle(3.05, 4.05, [])
    assert truth[-1].setpoint_m_s == (0.3, 0.3)
    envelope, truth = board.cycle(4.1, 4.12, [])
    assert truth[0].setpoint_m_s == (0.3, 0.3)
    assert envelope is not None
    assert envelope.asked_m_s == (0.3, 0.3)
    assert envelope.effort == (0.0, 0.0)


def test_a_command_that_was_lost_leaves_the_one_before_in_force() -> None:
    """By the board's echo 0.2 m/s is in force three cycles after zero was written: the wheels may turn so fast."""
    board = Board()
    board.hear(command(1.0, 200, 0.2))
    for i in range(3):
        board.cycle(1.1 + i * CYCLE_S, 1.12 + i * CYCLE_S, [])
    board.in_force.note_command(command(1.25, 0))
    for i in range(4):
        board.in_force.note_line(1.3 + i * CYCLE_S, 1.303 + i * CYCLE_S, has_clock=True)
        envelope = board.in_force.over_reading()
        board.in_force.note_echo(1.32 + i * CYCLE_S, (200.0, 200.0))
    assert envelope is not None
    assert envelope.asked_m_s == (0.2, 0.2)


def test_a_command_that_is_held_back_may_not_be_in_force() -> None:
    """40 is written, 160 waits on this side: half a second later the wheels may yet be driven by 40."""
    line = InForce()
    line.note_command(command(1.0, 40))
    line.note_command(command(1.2, 160), is_held_back=True)
    for i in range(10):
        line.note_line(1.21 + i * CYCLE_S, 1.213 + i * CYCLE_S, has_clock=True)
        envelope = line.over_reading()
    assert envelope == Envelope((0.2, 0.2), (), (0.16, 0.16), is_steady=False)
    line.note_command(command(1.8, 160))
    for i in range(4):
        line.note_line(1.81 + i * CYCLE_S, 1.813 + i * CYCLE_S, has_clock=True)
        envelope = line.over_reading()
    assert envelope == Envelope((0.8, 0.8), (), (0.16, 0.16))


def test_what_the_board_was_not_sent_drives_no_wheel() -> None:
    """It says that its motors stand, and was not told so: no effort is counted on."""
    line = InForce()
    line.note_command(command(1.0, 100))
    for i in range(4):
        line.note_line(1.1 + i * CYCLE_S, 1.103 + i * CYCLE_S, has_clock=True)
        envelope = line.over_reading()
        line.note_echo(1.12 + i * CYCLE_S, (0.0, 0.0))
    assert envelope == Envelope((0.0, 0.0), (), (0.1, 0.1))


def test_an_echo_that_comes_too_early_shows_a_board_that_acts_at_once() -> None:
    """Written 30 ms after the cycle began, and echoed in it."""
    line = InForce()
    line.note_command(command(1.0, 100))
    line.note_line(1.1, 1.103, has_clock=True)
    line.note_command(command(1.13, 60))
    line.note_echo(1.14, (60.0, 60.0))
    assert line.acts_at_once


def test_lines_that_waited_are_judged_by_what_was_in_force_before_the_pause() -> None:
    """A board without a clock is not heard for 0.4 s, and told to turn round meanwhile: its lines may be from before."""
    line = InForce()
    line.note_command(command(1.0, 160))
    for i in range(20):
        line.note_line(1.05 + i * 0.004, 1.05 + i * 0.004, has_clock=False)
        line.over_reading()
    line.note_command(command(1.3, -160))
    for i in range(15):
        line.note_line(1.53 + i * 0.002, 1.53 + i * 0.002, has_clock=False)
        envelope = line.over_reading()
        assert envelope is not None
        assert envelope.effort == (0.8, 0.8) or envelope.may_turn_round


def test_before_the_first_command_and_cycle_nothing_is_known() -> None:
    """No command, or no cycle in which one can have been read."""
    line = InForce()
    line.note_line(1.0, 1.0, has_clock=True)
    assert line.over_reading() is None
    assert line.likely_m_s() is None


def test_the_likely_speed_changes_when_the_board_says_so() -> None:
    """0.1 m/s from 2.0 to 2.8 s, by its echo, then 0.2 until 3.0 s: 0.12 m/s on the mean; 0.1 without an echo."""
    line = InForce()
    line.note_command(command(0.9, 100))
    line.note_line(1.0, 1.003, has_clock=True)
    line.note_command(command(1.5, 200))
    line.note_line(2.0, 2.003, has_clock=True)
    line.note_line(3.0, 3.003, has_clock=True)
    assert line.likely_m_s() == pytest.approx((0.1, 0.1))
    line.shown_at_s = 2.8
    assert line.likely_m_s() == pytest.approx((0.12, 0.12))
