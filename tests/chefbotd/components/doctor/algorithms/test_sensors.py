"""Conclusions about range sensors, the IMU, the battery and latency."""

import math

import pytest

from chefbotd.components.doctor.algorithms.finding import Verdict
from chefbotd.components.doctor.algorithms.latency import check_echo, check_latency, percentile
from chefbotd.components.doctor.algorithms.sensors import (
    Attitude,
    Beams,
    check_battery,
    check_beam_ahead,
    check_beams,
    check_imu,
    check_imu_lift,
    check_imu_turn,
)

NOSE_UP_RAD = -0.2  # REP-103: a positive pitch is nose down
LIFTED = Attitude(orientation=(0.0, math.sin(NOSE_UP_RAD / 2), 0.0, math.cos(NOSE_UP_RAD / 2)))
FLAT = Attitude(orientation=(0.0, 0.0, 0.0, 1.0))


def test_beams():
    """One that measures now and then is well; one that never does may be unplugged; one that says nothing is."""
    assert check_beams("front", Beams({"ok": 1, "no_echo": 9}, 1.2), kind="ultrasonic").verdict is Verdict.OK
    assert check_beams("front", Beams({"no_echo": 9}), kind="ultrasonic").verdict is Verdict.WARNING
    assert check_beams("front", Beams({"too_far": 9}), kind="infrared").verdict is Verdict.SKIPPED
    assert check_beams("front", None, kind="ultrasonic").verdict is Verdict.PROBLEM


def test_a_box_half_a_metre_ahead():
    """The front sensor must see it at about that."""
    assert check_beam_ahead("front", 2.5, 0.36).verdict is Verdict.OK
    assert check_beam_ahead("front", 2.5, 2.5).verdict is Verdict.PROBLEM
    assert check_beam_ahead("front", None, 0.5).verdict is Verdict.OK
    assert check_beam_ahead("front", 0.69, 0.7).verdict is Verdict.WARNING
    assert check_beam_ahead("front", None, None).verdict is Verdict.PROBLEM


def test_the_imu_at_rest():
    """Gravity along its z axis is up; along -z it hangs upside down."""
    assert check_imu([FLAT], configured=True, sends_imu=True).verdict is Verdict.OK
    upright, hanging = (Attitude(acceleration_m_s2=(0.1, 0.2, z)) for z in (9.7, -9.7))
    assert check_imu([upright], configured=True, sends_imu=True).verdict is Verdict.OK
    assert check_imu([hanging], configured=True, sends_imu=True).verdict is Verdict.PROBLEM
    assert check_imu([], configured=True, sends_imu=False).verdict is Verdict.WARNING
    assert check_imu([], configured=False, sends_imu=False).verdict is Verdict.SKIPPED


def test_an_imu_that_the_daemon_has_left_out_is_a_problem_with_its_reason():
    """The same words as in ``status``: that it sends, and flat, does not make it a good one."""
    reason = "the IMU shows -0.97 of the wheels' turns, the other way"
    found = check_imu([FLAT], configured=True, sends_imu=True, left_out=reason)
    assert found.verdict is Verdict.PROBLEM
    assert reason in found.measured


@pytest.mark.parametrize(
    ("imu_rad", "odometry_rad", "verdict"),
    [
        (1.5, 1.57, Verdict.OK),
        (-1.5, 1.57, Verdict.PROBLEM),
        (0.1, 1.57, Verdict.PROBLEM),
        (1.0, 1.57, Verdict.WARNING),
        (None, 1.57, Verdict.SKIPPED),
    ],
)
def test_a_turn_to_the_left(imu_rad: float | None, odometry_rad: float, verdict: Verdict):
    """The IMU's heading grows, as much as odometry's."""
    assert check_imu_turn(imu_rad, odometry_rad).verdict is verdict


def test_a_lifted_front():
    """Nose up is a negative pitch, or gravity along +x; the other way round the IMU looks backwards."""
    assert check_imu_lift(FLAT, LIFTED).verdict is Verdict.OK
    assert "11°" in check_imu_lift(FLAT, LIFTED).measured
    assert check_imu_lift(LIFTED, FLAT).verdict is Verdict.PROBLEM
    rest, up = Attitude(acceleration_m_s2=(0.0, 0.0, 9.81)), Attitude(acceleration_m_s2=(2.0, 0.0, 9.6))
    assert check_imu_lift(rest, up).verdict is Verdict.OK
    assert check_imu_lift(rest, rest).verdict is Verdict.PROBLEM


@pytest.mark.parametrize(
    ("volts", "sends", "verdict"),
    [
        (12.6, True, Verdict.OK),
        (11.9, True, Verdict.WARNING),
        (11.6, True, Verdict.PROBLEM),
        (0.4, True, Verdict.WARNING),
        (None, True, Verdict.PROBLEM),
        (None, False, Verdict.SKIPPED),
    ],
)
def test_the_battery(volts: float | None, sends: bool, verdict: Verdict):
    """Low from 12.0 V, flat from 11.7 V, and below 3 V nothing is wired."""
    finding = check_battery(volts, "", sends_battery=sends, absent_below_v=3.0, low_v=12.0, critical_v=11.7)
    assert finding.verdict is verdict


def test_latency():
    """The 99th of a hundred decides; too few are not judged. A board that obeys after 0.4 s is slow."""
    trips = [0.001] * 97 + [0.03] * 3
    assert percentile(trips, 0.5) == 0.001
    assert check_latency(trips, 0.0).verdict is Verdict.WARNING
    assert check_latency([0.001] * 50, 0.002).verdict is Verdict.OK
    assert check_latency([0.001] * 50, 0.2).verdict is Verdict.WARNING
    assert check_latency([0.001], None).verdict is Verdict.SKIPPED
    assert check_echo([0.05, 0.06]).verdict is Verdict.OK
    assert check_echo([0.4]).verdict is Verdict.WARNING
    assert check_echo([]).verdict is Verdict.SKIPPED
