"""Recognising sketches, by the figures measured on the published ones."""

import pytest

from chefbotd.components.doctor.algorithms.finding import Verdict
from chefbotd.components.doctor.algorithms.lines import LinesHeard
from chefbotd.components.doctor.algorithms.sketches import Expected, check_expected, check_sketch, recognise
from chefbotd.components.simulation.parameters.sketches import SketchName
from chefbotd.core.record import replace

EXPECTED = Expected("classic", 2, 255, 63)


def sends(lines: str, cycle_hz: float, *, wheels: int = 2, wire: str = "classic") -> LinesHeard:
    """What is heard of a board that sends so in five seconds."""
    return LinesHeard(
        seconds=5.0,
        bytes=10_000,
        kinds=dict.fromkeys(lines, round(5 * cycle_hz)),
        rates_hz=dict.fromkeys(lines, cycle_hz),
        wire=wire,
        wheels=wheels,
    )


PUBLISHED = [
    (sends("teusib", 20), SketchName.TIVA),
    (sends("teusib", 11), SketchName.TIVA),  # echoes that are waited for
    (sends("esb", 290), SketchName.TIVA_BARE),
    (sends("teusi", 50), SketchName.DUEMILANOVE),
    (sends("tesb", 200), SketchName.TIVA_SECOND),
    (sends("tesa", 50, wheels=4, wire="khan"), SketchName.KHAN),
    (sends("tqsa", 50, wheels=4, wire="khan_edges"), SketchName.KHAN),
]


@pytest.mark.parametrize(("heard", "sketch"), PUBLISHED, ids=lambda each: str(getattr(each, "value", "")))
def test_the_published_sketches(heard: LinesHeard, sketch: SketchName):
    """Lines and cycle of each, and of boards that leave a sensor out."""
    assert recognise(heard).sketch is sketch


def test_another_sketch_is_none_of_them():
    """A board that sends encoders alone, once a second, is not taken for any."""
    finding = check_sketch(sends("e", 1))
    assert finding.verdict is Verdict.WARNING
    assert "none of the known" in finding.measured


def test_another_number_of_wheels():
    """Four wheels on a wire that is configured for two: said, with the wire to set."""
    finding = check_expected(sends("tesa", 50, wheels=4, wire="khan"), EXPECTED)
    assert finding.verdict is Verdict.PROBLEM
    assert "wire = 'khan'" in finding.advice


def test_a_scale_and_a_buffer_that_the_sketch_does_not_have():
    """The Arduino's 63 bytes, and 255 of every published sketch."""
    finding = check_expected(sends("teusi", 50), replace(EXPECTED, max_duty=1023, board_buffer_bytes=1024))
    assert finding.verdict is Verdict.WARNING
    assert "max_duty = 255" in finding.advice
    assert "board_buffer_bytes = 63" in finding.advice
    assert check_expected(sends("teusi", 50), EXPECTED).verdict is Verdict.OK


def test_our_firmware_is_recognised_by_its_name_or_by_its_checked_lines() -> None:
    """In the checked mode it does not name itself; whoever listens then sees its checksums."""
    named = recognise(replace(LinesHeard(seconds=5.0), firmware="0.1"))
    checked = recognise(replace(LinesHeard(seconds=5.0), firmware="?"))
    assert (named.sketch, named.reason) == (SketchName.CHEFBOT, "it says so, version 0.1")
    assert (checked.sketch, checked.reason) == (SketchName.CHEFBOT, "its lines have checksums")
