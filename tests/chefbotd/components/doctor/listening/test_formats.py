"""What the doctor concludes of lines that are always refused, and of a clock in another unit."""

import pytest

from chefbotd.components.doctor.algorithms.finding import Verdict
from chefbotd.components.doctor.algorithms.lines import (
    LinesHeard,
    check_clock,
    check_damaged,
    check_formats,
    check_heard,
)
from chefbotd.components.doctor.listening.line_survey import LineSurvey

CYCLE_S = 0.05


def survey(time_unit: float = 1.0, **changed: str) -> LinesHeard:
    """What is heard in 5 s of a board some kinds of whose lines are written otherwise."""
    lines = LineSurvey("classic", 0.0)
    good = {"e": "e\t0\t0", "u": "u\t120", "s": "s\t0.00\t0.00", "b": "b\t2804.00"}
    for number in range(1, 101):
        micros = int(50_000 * number * time_unit)
        cycle = [f"t\t{micros}\t0.05", *{**good, **changed}.values()]
        lines.feed("".join(line + "\n" for line in cycle).encode(), CYCLE_S * number)
    return lines.heard(CYCLE_S * 100)


def test_a_good_board_has_neither() -> None:
    """The reference."""
    heard = survey()
    assert check_formats(heard) == []
    assert check_damaged(heard).verdict is Verdict.OK
    assert check_clock(heard).verdict is Verdict.OK


@pytest.mark.parametrize(("kind", "line"), [("u", "u\t57,3"), ("b", "b\t11.3V"), ("e", "e\t1")])
def test_a_refused_kind_is_a_format_and_no_cable(kind: str, line: str) -> None:
    """The kind, what it has and what was expected; nothing is said of damage, and the kind does not count as missing."""
    heard = survey(**{kind: line})
    (finding,) = check_formats(heard)
    assert finding.verdict is Verdict.PROBLEM
    assert f"every '{kind}' line is refused" in finding.measured
    assert line.replace("\t", "\\t") in finding.measured
    assert "cable is good" in finding.advice
    assert check_damaged(heard).verdict is Verdict.OK
    assert heard.sends(kind)


def test_encoder_lines_in_another_format_are_not_missing() -> None:
    """The finding on lines sends its reader to the one on the format, not for another sketch."""
    finding = check_heard(survey(e="e\t1"))
    assert finding.verdict is Verdict.PROBLEM
    assert "no encoder line is understood" in finding.measured
    assert finding.advice == "see the next finding"


def test_milliseconds_are_named() -> None:
    """And what the program on the board has to say in their place."""
    finding = check_clock(survey(time_unit=1e-3))
    assert finding.verdict is Verdict.PROBLEM
    assert "milliseconds" in finding.measured
    assert "micros()" in finding.advice
