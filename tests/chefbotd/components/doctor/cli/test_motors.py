"""Driving wheels on blocks: each fault of plugs, signs and scale is said, and nothing moves without a yes."""

import asyncio

import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.doctor.algorithms.finding import Finding, Verdict
from chefbotd.components.doctor.cli.motors import examine_motors, run_wheel
from chefbotd.settings import Settings
from tests.chefbotd.components.doctor.cli.bench import (
    Answers,
    bench,
    configured,
    diagnosis_of,
    found,
    straight,
)

BLOCKS = "Put the robot on blocks"
SEEN = "What did you see"
WRONG_SCALE_UP = {
    "drive__max_duty": 1023,
    "pid__ks_duty": 85.0,
    "pid__kv_duty_per_m_s": 2400.0,
    "pid__ka_duty_per_m_s2": 60.0,
    "pid__kp_duty_per_m_s": 800.0,
    "pid__ki_duty_per_m": 800.0,
    "pid__output_limit_duty": 1023.0,
    "pid__integral_limit_duty": 300.0,
}


def on_blocks(**overrides: object) -> Settings:
    """ChefBot with its wheels off the floor."""
    return configured(sim__body__mass_kg=0.0, sim__body__radius_m=0.05, **overrides)


def examined(
    believed: Settings, real: Settings | None = None, *, seen: str = "yes", outward: object = straight
) -> dict[str, Finding]:
    """The findings after somebody typed yes, and said the same of every wheel."""

    async def scenario() -> dict[str, Finding]:
        diagnosis = diagnosis_of(believed, Answers({BLOCKS: "yes", SEEN: seen}), motors=True)
        async with bench(believed, real, outward=outward) as robot:  # type: ignore[arg-type]
            await examine_motors(diagnosis, robot.robot)
            await asyncio.sleep(1.0)
            assert robot.board.duty == (0, 0)
        return found(diagnosis)

    return run_virtual(scenario())


@pytest.mark.slow
def test_a_robot_in_order():
    """Both wheels turn forward, and 255 is found to be full on, as it is configured."""
    findings = examined(on_blocks())
    assert findings["motor left_wheel"].verdict is Verdict.OK
    assert findings["motor right_wheel"].verdict is Verdict.OK
    assert findings["duty_scale"].verdict is Verdict.OK
    assert "max_duty is 255" in findings["duty_scale"].measured
    assert findings["command_latency"].verdict is Verdict.OK


@pytest.mark.slow
def test_a_board_of_255_that_is_believed_to_be_of_1023():
    """The wheel is much faster than asked, and nobody turns one by hand: neither scale nor counts are blamed."""
    finding = examined(on_blocks(**WRONG_SCALE_UP), on_blocks())["duty_scale"]
    assert finding.verdict is Verdict.PROBLEM
    assert "but [drive] max_duty is 1023; wrong counts per turn look the same" in finding.measured
    assert "ten times by hand" in finding.advice
    assert "max_duty =" not in finding.advice


@pytest.mark.slow
def test_a_board_of_1023_that_is_believed_to_be_of_255():
    """The wheel hardly turns, and nobody turns one by hand: the same."""
    finding = examined(on_blocks(), on_blocks(sim__board__pwm_full_scale=1023))["duty_scale"]
    assert finding.verdict is Verdict.PROBLEM
    assert "but [drive] max_duty is 255; wrong counts per turn look the same" in finding.measured
    assert "ten times by hand" in finding.advice


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seen", "advice"), [("yes", "encoder_sign = 1"), ("", "motor_sign = -1"), ("", "encoder_sign = 1")]
)
def test_a_swapped_encoder_sign(seen: str, advice: str):
    """The wheel runs forward and counts backward: with an eye on it its encoder is to blame, without one either."""
    wrong = {"chassis__wheels__left_wheel__encoder_sign": -1}
    finding = examined(on_blocks(**wrong), on_blocks(), seen=seen)["motor left_wheel"]
    assert finding.verdict is Verdict.PROBLEM
    assert advice in finding.advice


@pytest.mark.slow
def test_a_motor_that_is_wired_backwards():
    """It was seen to turn backward, and its encoder says so too: the motor's sign is wrong."""
    wrong = {"chassis__wheels__right_wheel__motor_sign": -1}
    finding = examined(on_blocks(**wrong), on_blocks(), seen="back")["motor right_wheel"]
    assert finding.verdict is Verdict.PROBLEM
    assert "set motor_sign = 1 for right_wheel" in finding.advice


def swapped(data: bytes) -> bytes:
    """The motors' plugs exchanged: each ``s`` line's two duties change places."""
    lines = data.split(b"\r")
    return b"\r".join(
        b" ".join((b"s", fields[2], fields[1])) if (fields := line.split()) and fields[0] == b"s" else line
        for line in lines
    )


@pytest.mark.slow
def test_motors_whose_plugs_are_exchanged():
    """The other wheel's encoder counts: the motors are said to be exchanged, with and without an eye on them."""
    for seen in ("other", ""):
        finding = examined(on_blocks(), seen=seen, outward=swapped)["motor left_wheel"]
        assert finding.verdict is Verdict.PROBLEM
        assert "right_wheel counted" in finding.measured
        assert "exchange the motors' plugs of left_wheel and right_wheel" in finding.advice


@pytest.mark.slow
def test_motors_to_which_no_command_comes():
    """The board says that it drives none: the line is to be checked and no wheel, and the scale is not guessed at."""
    findings = examined(on_blocks(), seen="none", outward=lambda data: b"")
    assert findings["motor left_wheel"].verdict is Verdict.PROBLEM
    assert "check the line to the board first" in findings["motor left_wheel"].advice
    assert findings["duty_scale"].verdict is Verdict.SKIPPED


@pytest.mark.parametrize(
    "answer", [None, "", "y", "Yes", "yes please"], ids=["nobody", "enter", "y", "Yes", "more"]
)
def test_nothing_moves_without_a_yes(answer: str | None):
    """Only the word yes, typed whole, lets wheels turn."""

    async def scenario() -> None:
        asker = Answers({} if answer is None else {BLOCKS: answer})
        diagnosis = diagnosis_of(on_blocks(), asker, motors=True)
        async with bench(on_blocks()) as robot:
            before = robot.board.truth(0.0)
            written = len(robot.device.written)
            await examine_motors(diagnosis, robot.robot)
            assert found(diagnosis)["motors"].verdict is Verdict.SKIPPED
            assert len(robot.device.written) == written
            assert robot.board.truth(0.0).world_from_base == before.world_from_base

    run_virtual(scenario())


def test_no_question_where_motors_were_not_asked_for():
    """Without --motors nobody is even asked."""

    async def scenario() -> None:
        asker = Answers({BLOCKS: "yes"})
        diagnosis = diagnosis_of(on_blocks(), asker)
        async with bench(on_blocks()) as robot:
            await examine_motors(diagnosis, robot.robot)
        assert not asker.asked
        assert found(diagnosis)["motors"].verdict is Verdict.SKIPPED

    run_virtual(scenario())


def test_a_cancelled_run_stops_the_motors():
    """Ctrl-C in mid-run: zero is on the wire at once, and stays."""

    async def scenario() -> None:
        settings = on_blocks()
        diagnosis = diagnosis_of(settings, Answers(), motors=True)
        async with bench(settings) as robot:
            run = asyncio.create_task(run_wheel(diagnosis, robot.robot, diagnosis.wheels[0]))
            await asyncio.sleep(0.6)
            assert robot.board.duty[0] > 0
            run.cancel()
            await asyncio.gather(run, return_exceptions=True)
            await asyncio.sleep(0.3)
            assert robot.board.duty == (0, 0)

    run_virtual(scenario())


@pytest.mark.slow
def test_a_stop_of_somebody_else_ends_the_run_for_good():
    """An e-stop during the first wheel: the doctor does not arm the robot again, and drives no other wheel."""

    async def scenario() -> None:
        settings = on_blocks()
        async with bench(settings) as robot:

            async def press() -> None:
                await robot.robot.estop("the button")

            asker = Answers({BLOCKS: "yes"}, {"left_wheel was driven": press})
            diagnosis = diagnosis_of(settings, asker, motors=True)
            await examine_motors(diagnosis, robot.robot)
            assert found(diagnosis)["motor right_wheel"].verdict is Verdict.SKIPPED
            assert "estopped: the button" in found(diagnosis)["motor right_wheel"].measured
            assert (await robot.robot.get_state()).safety.mode == "estopped"

    run_virtual(scenario())
