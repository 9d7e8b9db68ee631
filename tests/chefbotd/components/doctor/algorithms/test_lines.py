"""Conclusions from a board's lines."""

import pytest

from chefbotd.components.doctor.algorithms.finding import Verdict
from chefbotd.components.doctor.algorithms.lines import (
    LinesHeard,
    check_at_rest,
    check_clock,
    check_damaged,
    check_heard,
    check_left_on,
)
from chefbotd.core.record import replace

GOOD = LinesHeard(
    seconds=5.0,
    bytes=9000,
    kinds={"t": 100, "e": 100, "s": 100, "b": 100},
    rates_hz={"t": 20.0, "e": 20.0, "s": 20.0, "b": 20.0},
    wire="classic",
    wheels=2,
    clock_ppm=120.0,
    clock_s=5.0,
    duty=(0.0, 0.0),
    counted=(0, 1),
)


def test_lines_in_order():
    """Each kind is told with its name and its rate."""
    finding = check_heard(GOOD)
    assert finding.verdict is Verdict.OK
    assert "e (encoders) 20.0 a second" in finding.measured


@pytest.mark.parametrize(
    ("heard", "said"),
    [
        (LinesHeard(5.0), "nothing was received for 5.0 s"),
        (LinesHeard(5.0, bytes=400, garbled_share=0.6, sample="\\xf8"), "60% of 400 bytes are not text"),
        (LinesHeard(5.0, bytes=400, sample="AT OK"), "hardly any valid line of a board"),
        (replace(GOOD, kinds={"t": 100}), "no encoder lines"),
    ],
    ids=["silent", "garbled", "text", "without encoders"],
)
def test_what_is_no_board_is_a_problem(heard: LinesHeard, said: str):
    """Silence, garbage, another device's text and a board without encoders each have their own words."""
    finding = check_heard(heard)
    assert finding.verdict is Verdict.PROBLEM
    assert said in finding.measured
    assert finding.advice


@pytest.mark.parametrize(
    ("damaged", "verdict"), [(0, Verdict.OK), (3, Verdict.OK), (5, Verdict.WARNING), (45, Verdict.PROBLEM)]
)
def test_damaged_lines(damaged: int, verdict: Verdict):
    """Of 400 good lines: below 1 % is well, from 10 % on a problem (45 of 445 are 10.1 %)."""
    assert (
        check_damaged(replace(GOOD, damaged={"not_a_number": damaged} if damaged else {})).verdict is verdict
    )


@pytest.mark.parametrize(
    ("ppm", "span_s", "verdict"),
    [
        (1999.0, 5.0, Verdict.OK),
        (-2100.0, 5.0, Verdict.WARNING),
        (9000.0, 1.0, Verdict.SKIPPED),
        (None, 5.0, Verdict.SKIPPED),
    ],
)
def test_the_boards_clock(ppm: float | None, span_s: float, verdict: Verdict):
    """It may drift by 2000 millionths; what was heard too briefly is not judged."""
    assert check_clock(replace(GOOD, clock_ppm=ppm, clock_s=span_s)).verdict is verdict


def test_a_board_that_tells_no_time_is_in_order():
    """Sketch B has no 't' lines, and drives."""
    assert check_clock(replace(GOOD, kinds={"e": 9, "s": 9, "b": 9})).verdict is Verdict.OK


def test_motors_that_are_on_while_nobody_drives():
    """An echo of a duty that nobody asked for is the worst there is to find: keep clear."""
    finding = check_at_rest(replace(GOOD, duty=(0.0, -40.0)), 4200)
    assert finding.verdict is Verdict.PROBLEM
    assert "s 0 -40" in finding.measured


def test_motors_that_a_dead_program_left_on():
    """Without a daemon an echo of a duty is one that nobody will take back: said; zeros say nothing."""
    (finding,) = check_left_on((0.0, 55.0))
    assert finding.verdict is Verdict.PROBLEM
    assert "s 0 55" in finding.measured
    assert not check_left_on((0.0, 0.0))


def test_an_encoder_that_counts_at_rest():
    """40 counts of 4200 are 0.06 rad: more than play."""
    assert check_at_rest(replace(GOOD, counted=(40, 0)), 4200).verdict is Verdict.WARNING
    assert check_at_rest(replace(GOOD, counted=(3, -3)), 4200).verdict is Verdict.OK
