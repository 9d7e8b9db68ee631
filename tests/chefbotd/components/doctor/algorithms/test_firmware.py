"""The doctor's finding about the board's firmware."""

from chefbotd.components.doctor.algorithms.finding import Verdict
from chefbotd.components.doctor.algorithms.firmware import FirmwareFacts, check_firmware
from chefbotd.components.doctor.algorithms.sketches import recognise
from chefbotd.components.doctor.listening.line_survey import LineSurvey, echo_delays_s
from chefbotd.components.simulation.parameters.sketches import SketchName
from firmware_protocol.checked import seal

OURS = FirmwareFacts("0.1", "tm4c123", 250, "brown_out", 1, 2, 0, 3, 0.0125)


def test_a_classic_sketch_is_offered_the_firmware_that_stops():
    """It is no fault of the board, so all is well; the advice names the command."""
    finding = check_firmware(None, is_board=True)
    assert finding.verdict is Verdict.OK
    assert "not known to stop by itself" in finding.measured
    assert "chefbotctl flash" in finding.advice


def test_our_firmware_says_its_version_its_dead_man_and_its_figures():
    """Version, board, 250 ms, the last start, what was damaged, refused and stopped, and the round trip."""
    finding = check_firmware(OURS, is_board=True)
    assert finding.verdict is Verdict.OK
    assert finding.measured == (
        "chefbot firmware 0.1 on tm4c123; it stops 250 ms after the last command; last start by brown_out, "
        "1 lines damaged, 2 refused, 3 stops by its dead-man, round trip 12.5 ms"
    )


def test_our_firmware_without_its_dead_man_is_a_warning():
    """Nobody has agreed on the checked mode: it is driven like a classic sketch."""
    finding = check_firmware(FirmwareFacts("0.1", "tm4c123", None, reason="no answer"), is_board=True)
    assert finding.verdict is Verdict.WARNING
    assert "does not stop by itself now: no answer" in finding.measured


def test_lost_bytes_are_a_warning_and_nothing_heard_is_not_judged():
    """Seven overruns are told; a port without a board has no firmware."""
    lost = check_firmware(FirmwareFacts("0.1", "host", 250, overruns=7), is_board=True)
    assert (lost.verdict, "7 bytes" in lost.measured) == (Verdict.WARNING, True)
    assert check_firmware(None, is_board=False).verdict is Verdict.SKIPPED


def test_our_firmware_is_recognised_in_both_modes():
    """By its name in the classic mode, and by its checked lines where only these were heard."""
    survey = LineSurvey("classic", 0.0)
    survey.feed(b"x\nfirmware\t1\t0\t1\t2\t3\t1\nt\t1000\t0.02\ne\t1\t2\n", 1.0)
    heard = survey.heard(1.0)
    assert (heard.firmware, recognise(heard).sketch) == ("0.1", SketchName.CHEFBOT)
    survey = LineSurvey("classic", 0.0)
    bodies = (b"t\t1000\t0.010", b"e\t1\t2", b"s\t50\t-40\t7", b"u\t93\t4000")
    survey.feed(b"x\n" + b"".join(seal(body, n, b"\t") + b"\n" for n, body in enumerate(bodies)), 1.0)
    heard = survey.heard(1.0)
    assert (heard.firmware, recognise(heard).sketch) == ("?", SketchName.CHEFBOT)
    assert (dict(heard.kinds), heard.duty) == ({"t": 1, "e": 1, "s": 1, "u": 1}, (50, -40))


def test_the_delay_of_a_checked_command_is_known_by_its_echo():
    """Written at 1.00 s, echoed at 1.02 s: 20 ms, seals and numbers left aside."""
    lines = [
        (1.00, True, seal(b"s 50 -40", 3, b" ")),
        (1.01, False, seal(b"s\t0\t0\t2", 8, b"\t")),
        (1.02, False, seal(b"s\t50\t-40\t3", 11, b"\t")),
    ]
    assert [round(delay, 6) for delay in echo_delays_s(lines, 2)] == [0.02]
