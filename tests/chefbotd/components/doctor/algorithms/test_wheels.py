"""Conclusions about encoders, motors and the duty's scale."""

import math

import pytest

from chefbotd.components.doctor.algorithms.finding import Verdict
from chefbotd.components.doctor.algorithms.wheels import (
    WheelRun,
    WheelSample,
    WheelSetting,
    check_distance,
    check_hand_turns,
    check_motor,
    check_push,
    check_scale,
    check_turn,
    full_scale,
)

LEFT = WheelSetting("left", is_left=True, radius_m=0.05, motor_sign=1, encoder_sign=-1)
RIGHT = WheelSetting("right", is_left=False, radius_m=0.05, motor_sign=1, encoder_sign=1)
BOTH = (LEFT, RIGHT)


def run(
    *, left_rad: float = 0.0, right_rad: float = 0.0, duty: int = 60, speed: float = 0.0, seen: str = ""
) -> WheelRun:
    """The left wheel was asked; both turned so far, the left one with this speed at the end."""
    zero = {"left": 0.0, "right": 0.0}
    start = WheelSample(0.0, zero, zero, {"left": 0, "right": 0})
    turned = {"left": left_rad, "right": right_rad}
    end = WheelSample(1.0, turned, {"left": speed, "right": 0.0}, {"left": duty, "right": 0})
    return WheelRun("left", (start, end), seen=seen)


def test_a_push_forward():
    """One wheel counts forward, one backward; of one that counts nothing the plug is asked for."""
    left, right = check_push(BOTH, {"left": -5.1, "right": 6.3})
    assert left.verdict is Verdict.PROBLEM
    assert "encoder_sign = 1 for left" in left.advice
    assert right.verdict is Verdict.OK
    (nothing,) = check_push(BOTH, {"right": 0.01})
    assert nothing.check == "encoders"
    assert nothing.verdict is Verdict.PROBLEM
    still, _ = check_push(BOTH, {"right": 6.3})
    assert still.verdict is Verdict.PROBLEM
    assert "counts nothing" in still.measured


def test_half_of_the_counts():
    """4200 counts assumed and 2100 there: 0.15 m instead of 0.3 m, and 2100 is what to set."""
    finding = check_distance(0.15, 0.30, 4200)
    assert finding.verdict is Verdict.PROBLEM
    assert "counts_per_turn = 2100" in finding.advice
    assert check_distance(0.29, 0.30, 4200).verdict is Verdict.OK
    assert check_distance(0.29, 0.0, 4200).verdict is Verdict.SKIPPED


def test_a_turn_to_the_left():
    """Counted as one to the right, the sides' encoders are exchanged."""
    assert check_turn(1.4, BOTH, {}).verdict is Verdict.OK
    finding = check_turn(-1.4, BOTH, {"left": 4.0, "right": -4.2})
    assert finding.verdict is Verdict.PROBLEM
    assert "exchanged" in finding.measured
    assert check_turn(0.02, BOTH, {}).verdict is Verdict.PROBLEM


@pytest.mark.parametrize(
    ("driven", "verdict", "advice"),
    [
        (run(left_rad=2.0, seen="forward"), Verdict.OK, ""),
        (run(left_rad=2.0), Verdict.OK, ""),
        (run(left_rad=-2.0, seen="forward"), Verdict.PROBLEM, "set encoder_sign = 1 for left"),
        (run(left_rad=-2.0, seen="backward"), Verdict.PROBLEM, "set motor_sign = -1 for left"),
        (
            run(left_rad=2.0, seen="backward"),
            Verdict.PROBLEM,
            "set motor_sign = -1 and encoder_sign = 1 for left",
        ),
        (run(left_rad=2.0, seen="other"), Verdict.PROBLEM, "exchange the wheels' plugs"),
        (run(right_rad=2.0, seen="other"), Verdict.PROBLEM, "exchange the motors' plugs of left and right"),
        (
            run(right_rad=2.0, seen="forward"),
            Verdict.PROBLEM,
            "exchange the encoders' plugs of left and right",
        ),
        (run(left_rad=-0.3, right_rad=2.0), Verdict.PROBLEM, "exchange the motors' plugs of left and right"),
        (run(seen="forward"), Verdict.PROBLEM, "check the encoder's plug"),
        (run(seen="nothing"), Verdict.PROBLEM, "check the bridge's power"),
        (WheelRun("left", ()), Verdict.SKIPPED, ""),
        (run(duty=0, seen="nothing"), Verdict.SKIPPED, ""),
    ],
)
def test_a_wheel_that_was_driven_forward(driven: WheelRun, verdict: Verdict, advice: str):
    """What the encoders say and what somebody saw, held against each other."""
    finding = check_motor(BOTH, driven)
    assert finding.verdict is verdict
    assert advice in finding.advice


def test_the_full_scale_by_hand():
    """0.36 m/s under load is 0.4 m/s free, 8 rad/s; 4 rad/s at duty 110 is 0.1 + 0.9 / 2 = 0.55 of full: 200."""
    assert full_scale(run(left_rad=2.0, duty=110, speed=4.0), LEFT, 0.36) == pytest.approx(200.0)
    assert full_scale(run(duty=110), LEFT, 0.36) is None


@pytest.mark.parametrize(
    ("max_duty", "duty", "verdict", "advice"),
    [
        (255, 130, Verdict.OK, ""),
        (1023, 130, Verdict.PROBLEM, "max_duty = 255, and multiply every gain"),
        (255, 520, Verdict.PROBLEM, "max_duty = 1023, and multiply every gain"),
        (1023, 520, Verdict.OK, ""),
    ],
)
def test_the_scale_that_is_configured(max_duty: int, duty: int, verdict: Verdict, advice: str):
    """At 0.55 of full, duty 130 tells 236 and duty 520 tells 945."""
    driven = run(left_rad=2.0, duty=duty, speed=4.0)
    finding = check_scale(BOTH, [driven], max_duty=max_duty, max_rim_speed_m_s=0.36)
    assert finding.verdict is verdict
    assert advice in finding.advice


def test_a_speed_that_does_not_fit_blames_no_scale_before_a_wheel_was_turned_by_hand():
    """Four times too many counts per turn look like a full scale of 1023: neither is told as the cause."""
    driven = run(left_rad=2.0, duty=520, speed=4.0)
    finding = check_scale(BOTH, [driven], max_duty=255, max_rim_speed_m_s=0.36, counts_are_right=False)
    assert finding.verdict is Verdict.PROBLEM
    assert "wrong counts per turn look the same" in finding.measured
    assert "ten times by hand" in finding.advice
    assert "max_duty =" not in finding.advice


@pytest.mark.parametrize(
    ("turns", "verdict", "advice"),
    [
        (10.3, Verdict.OK, ""),
        (2.5, Verdict.PROBLEM, "counts_per_turn = 1050 (it is 4200"),
        (20.0, Verdict.PROBLEM, "counts_per_turn = 8400"),
        (0.0, Verdict.SKIPPED, ""),
    ],
)
def test_ten_turns_by_hand_show_the_counts_per_turn(turns: float, verdict: Verdict, advice: str):
    """What the encoder makes of ten turns, forwards or backwards."""
    finding = check_hand_turns("left", -turns * math.tau, 4200.0)
    assert finding.verdict is verdict
    assert advice in finding.advice


def test_a_wheel_that_was_never_driven():
    """The daemon refused, or an obstacle held it: said, and no wire is blamed."""
    refused = check_motor(BOTH, WheelRun("left", (), refused="somebody else drives"))
    held = check_motor(BOTH, WheelRun("left", run(duty=0).samples, held_by="obstacle:front"))
    assert "(somebody else drives)" in refused.measured
    assert "(obstacle:front)" in held.measured


def test_a_wheel_to_which_no_command_comes_is_not_to_blame():
    """The daemon says that the line is jammed: neither the bridge's power nor the motor's wires are suspected."""
    still = run()
    lost = WheelRun("left", still.samples, fault="commands_lost", reason="no command reaches the board")
    found = check_motor(BOTH, lost)
    assert found.verdict is Verdict.PROBLEM
    assert "no command reaches the board" in found.measured
    assert found.advice.startswith("check the line to the board")
    assert "bridge" not in found.advice
