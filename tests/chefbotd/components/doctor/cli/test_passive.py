"""Listening to simulated boards: each sketch is recognised, and each fault of the line is said."""

import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.doctor.algorithms.finding import Finding, Verdict
from chefbotd.components.doctor.cli.passive import examine_robot
from chefbotd.settings import Settings
from tests.chefbotd.components.doctor.cli.bench import (
    Answers,
    bench,
    configured,
    diagnosis_of,
    found,
    straight,
)
from tests.fakes.bad_cable import BadCable, CableParameters

pytestmark = pytest.mark.slow


def heard(
    believed: Settings, real: Settings | None = None, *, seconds: float = 3.0, inward: object = straight
) -> dict[str, Finding]:
    """The findings of one diagnosis that touches nothing."""

    async def scenario() -> dict[str, Finding]:
        diagnosis = diagnosis_of(believed, Answers(), seconds=seconds)
        async with bench(believed, real, inward=inward) as robot:  # type: ignore[arg-type]
            await examine_robot(diagnosis, robot.robot)
        return found(diagnosis)

    return run_virtual(scenario())


@pytest.mark.parametrize(
    ("sketch", "letter"), [("tiva", "A"), ("tiva_bare", "B"), ("duemilanove", "C"), ("tiva_second", "D")]
)
def test_each_published_sketch_is_recognised(sketch: str, letter: str):
    """By the lines it sends, how often, and its banner."""
    findings = heard(configured(sim__board__sketch=sketch))
    assert findings["lines"].verdict is Verdict.OK
    assert f"sketch {letter}," in findings["sketch"].measured
    assert findings["configured_board"].verdict is Verdict.OK


def test_lines_that_a_board_leaves_out_are_named_before_anything_is_suspected():
    """Sketch B sends neither time nor ultrasonic nor IMU; its duty echo and its battery come."""
    findings = heard(configured(sim__board__sketch="tiva_bare"))
    missing = findings["missing_lines"]
    assert [kind for kind in "tsuib" if f"no {kind!r} lines" in missing.measured] == ["t", "u", "i"]
    assert list(findings).index("missing_lines") < list(findings).index("at_rest")


def test_khan_is_recognised():
    """Four wheels on the wire."""
    findings = heard(configured("khan"))
    assert "KHAN's" in findings["sketch"].measured


def test_a_robot_in_order_has_no_problem_and_no_warning():
    """ChefBot as it is published: everything that needs no hand is looked at."""
    findings = heard(configured())
    bad = {check for check, each in findings.items() if each.verdict in (Verdict.WARNING, Verdict.PROBLEM)}
    assert bad <= {"latency"}  # which is the real computer's
    assert {
        "baud",
        "lines",
        "damaged_lines",
        "sketch",
        "board_clock",
        "at_rest",
        "battery",
        "imu",
        "pose",
    } <= set(findings)


def test_a_flat_battery():
    """Without charge it is said to be flat, with what to do."""
    finding = heard(configured(sim__battery__start_charge_share=0.02))["battery"]
    assert finding.verdict is Verdict.PROBLEM
    assert "flat" in finding.measured
    assert finding.advice == "charge it now"


def test_damaged_lines():
    """A cable that flips one byte in 300 damages some lines in a hundred: said with an example."""
    cable = BadCable(CableParameters(flip_share=1 / 300), seed=3)
    finding = heard(configured(), inward=cable.carry)["damaged_lines"]
    assert finding.verdict is Verdict.WARNING
    assert "such as" in finding.measured
    assert "USB cable" in finding.advice


def test_no_lines():
    """A port at which nothing comes is said to be silent, and the board's power is asked for."""
    finding = heard(configured(), inward=lambda data: b"")["lines"]
    assert finding.verdict is Verdict.PROBLEM
    assert "nothing was received" in finding.measured
    assert "powered" in finding.advice


def test_a_configured_scale_that_the_sketch_does_not_have():
    """Without a wheel turning: the published sketches are full on at 255, whatever the configuration says."""
    finding = heard(configured(drive__max_duty=1023))["configured_board"]
    assert finding.verdict is Verdict.WARNING
    assert "max_duty = 255" in finding.advice


def test_the_arduino_with_a_buffer_that_it_does_not_have():
    """Its ring holds 63 bytes: a configuration that sends more ahead is told."""
    believed = configured(sim__board__sketch="duemilanove", link__board_buffer_bytes=1024)
    finding = heard(believed)["configured_board"]
    assert finding.verdict is Verdict.WARNING
    assert "board_buffer_bytes = 63" in finding.advice
