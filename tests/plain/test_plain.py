"""What is written in one piece for speed does what the plain version does."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import astuple, replace

from chefbotd.core.geometry import Pose2D, PoseCovariance, Twist2D
from chefbotd.link.board_clock import ClockRelation
from chefbotd.motion import encoder, odometry, pid, reference
from chefbotd.motion.drive import Drive
from chefbotd.motion.drive_state import DriveParameters
from chefbotd.motion.encoder import EncoderParameters, Reading
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.motion.odometry import OdometryParameters, OdometryState
from chefbotd.motion.pid import PidParameters, PidState
from chefbotd.motion.reference import Asked
from chefbotd.motion.setpoints import Setpoints
from chefbotd.safety import overspeed, wheels
from chefbotd.safety.overspeed import Excess, OverspeedParameters
from chefbotd.safety.wheels import PushedWheel, WheelWatchParameters
from tests.budget import examples
from tests.chefbotd.driving.rig import CHASSIS, LIMITS
from tests.chefbotd.driving.rig import GAINS as RIG_GAINS
from tests.plain import encoder as plain_encoder
from tests.plain import odometry as plain_odometry
from tests.plain import pid as plain_pid
from tests.plain import wheels as plain_wheels

speeds = st.floats(-0.5, 0.5)
GAINS = st.builds(
    lambda **gains: PidParameters(**gains),
    kp=st.floats(0, 300),
    ki=st.floats(0, 300),
    kd=st.floats(0, 20),
    ks=st.floats(0, 40),
    kv=st.floats(0, 600),
    ka=st.floats(0, 50),
    output_limit=st.floats(10, 300),
    integral_limit=st.none() | st.floats(0, 300),
    deadband=st.sampled_from([0.0, 0.01]),
    derivative_filter_s=st.floats(0, 0.2),
    back_calculation_s=st.none() | st.floats(0.01, 1),
    conditional_integration=st.booleans(),
)
STEPS = st.lists(st.tuples(speeds, speeds, speeds, st.floats(-0.01, 0.1)), min_size=1, max_size=20)


@given(GAINS, STEPS, st.floats(-200, 200), st.floats(0, 30), st.sampled_from([0.2, 1.0]))
@settings(max_examples=examples(300))
def test_a_step_of_the_pid(
    gains: PidParameters,
    steps: list[tuple[float, float, float, float]],
    fading: float,
    scrub: float,
    share: float,
) -> None:
    """Any gains, setpoints and measurements, also after new gains have left something to fade."""
    state = plain = PidState(fading_duty=fading, setpoint_m_s=0.2)
    for setpoint, acceleration, measured, dt_s in steps:
        state, duty = pid.step(gains, state, setpoint, acceleration, measured, dt_s, scrub, share)
        plain, expected = plain_pid.step(gains, plain, setpoint, acceleration, measured, dt_s, scrub, share)
        assert (state, duty) == (plain, expected)


FRAMES = st.lists(
    st.tuples(
        st.integers(-30, 40),
        st.integers(-45, 25),
        st.sampled_from([0, 0, 0, 0, 0, 90, 25_000, -700, 31_000]),
        st.sampled_from([0.01, 0.01, 0.01, 0.02, 0.0, -0.01, 3.0]),
    ),
    min_size=1,
    max_size=40,
)


def close(reading: Reading) -> list[object]:
    """All that it says; numbers to the last bits."""
    return [
        pytest.approx(value, rel=1e-12, abs=1e-9) if isinstance(value, float | tuple) else value
        for value in astuple(reading)
    ]


@example([(0, 0, 0, 0.01)] * 4 + [(0, 0, 0, -0.01)], 300.0, 0.0, 16)
@given(FRAMES, st.sampled_from([None, 300.0]), st.sampled_from([0.0, 0.4]), st.sampled_from([16, 32]))
@settings(max_examples=examples(300))
def test_a_frame_of_the_encoders(
    frames: list[tuple[int, int, int, float]], acceleration: float | None, standstill: float, bits: int
) -> None:
    """Wheels that turn, jump, surprise, wrap and stand, at any board times; the right encoder counts backwards."""
    params = EncoderParameters(
        counts_per_turn=990,
        width_bits=bits,
        max_speed_rad_s=40,
        standstill_rad_s=standstill,
        max_acceleration_rad_s2=acceleration,
    )
    plain, state = plain_encoder.Decoder(params, (1, -1)), encoder.START
    left, right, board_s = 32_700, -5, 50.0
    for left_step, right_step, damage, dt_s in frames:
        left, right, board_s = left + left_step, right + right_step, board_s + dt_s
        half = 2 ** (bits - 1)
        counts = ((left + damage + half) % (2 * half) - half, (right + half) % (2 * half) - half)
        state, reading = encoder.decode(params, (1, -1), state, counts, board_s)
        assert list(astuple(reading)) == close(plain.decode(counts, board_s))


@given(
    st.lists(
        st.tuples(st.floats(-1, 1), st.floats(-0.2, 0.2), st.floats(0.001, 0.3)), min_size=1, max_size=60
    )
)
@settings(max_examples=examples(200))
def test_a_wheel_that_is_watched(readings: list[tuple[float, float, float]]) -> None:
    """Whatever it is driven with and however it turns."""
    params, state, plain = WheelWatchParameters(), wheels.at_rest(1), PushedWheel()
    for effort, travel_rad, dt_s in readings:
        state, _ = wheels.watch(params, ("left",), state, (effort,), (travel_rad,), dt_s, 0.019)
        plain = plain_wheels.push(params, plain, effort, travel_rad, dt_s, 0.019)
        assert state.pushes == (plain,)


@given(
    st.lists(
        st.tuples(st.floats(0.01, 0.5), st.floats(-0.05, 0.05), st.floats(0.001, 0.3)),
        min_size=1,
        max_size=60,
    )
)
@settings(max_examples=examples(200))
def test_a_wheel_that_may_be_too_fast(readings: list[tuple[float, float, float]]) -> None:
    """Whatever it is asked for and however far it rolls."""
    params, state, plain = OverspeedParameters(), overspeed.at_rest(1), Excess()
    for asked_m_s, travel_m, dt_s in readings:
        state, _ = overspeed.watch(params, ("left",), state, (asked_m_s,), (travel_m,), dt_s)
        plain = plain_wheels.add(params, plain, asked_m_s, travel_m, dt_s)
        assert state == (plain,)


@given(
    st.lists(st.tuples(st.floats(0.005, 0.06), speeds, speeds), min_size=1, max_size=30),
    st.floats(0.01, 0.3),
    st.floats(0, 0.2),
)
@settings(max_examples=examples(200))
def test_the_mean_of_what_was_asked_for(
    asked: list[tuple[float, float, float]], over_s: float, delay_s: float
) -> None:
    """The time average of a staircase that stood before its first step, by a fine sum."""
    history: reference.History = ()
    for duration_s, left, right in asked:
        history = reference.remember(history, Asked(duration_s, (left, right)), over_s + delay_s)
    ends_s = np.cumsum([step[0] for step in reversed(asked)])
    grid_s = delay_s + (np.arange(20_000) + 0.5) / 20_000 * over_s
    step = np.searchsorted(ends_s, grid_s)
    for wheel in (0, 1):
        speed = np.array([*[each[1 + wheel] for each in reversed(asked)], 0.0])
        expected = speed[np.minimum(step, len(asked))].mean()
        assert reference.mean_m_s(history, over_s, delay_s)[wheel] == pytest.approx(expected, abs=2e-3)


@given(st.lists(st.floats(0, 0.02), min_size=12, max_size=120), st.floats(-200e-6, 200e-6))
@settings(max_examples=examples(100))
def test_the_relation_of_the_clocks(late_s: list[float], skew: float) -> None:
    """The weighted least squares of all readings that were not too late, solved by numpy; weights fade with 120 s."""
    relation, kept = ClockRelation(), []
    for number, late in enumerate(late_s):
        board_s = 40.0 + 0.05 * number
        host_s, excluded = 900.0 + board_s * (1 + skew) + late, relation.excluded
        relation.observe(board_s, host_s)
        if relation.excluded == excluded:
            kept.append((board_s, host_s))
    board, host = np.array(kept).T
    weight = np.sqrt(np.exp((board - board[-1]) / ClockRelation.MEMORY_S))
    offset = board - np.average(board, weights=weight**2)
    (base, rate), *_ = np.linalg.lstsq(
        np.column_stack([weight, weight * offset]), weight * (host - board), rcond=None
    )
    if np.sum((weight * offset) ** 2) <= 1.0:
        rate = 0.0
    assert relation.host_s(board[-1]) == pytest.approx(board[-1] + base + rate * offset[-1], abs=1e-6)


@given(speeds, st.floats(-4, 4), st.floats(0.01, 0.4))
def test_the_fastest_rim(linear_m_s: float, angular_rad_s: float, most_m_s: float) -> None:
    """A twist is slowed so that the faster of the rims, 0.15 m off the middle of four wheels, goes that fast."""
    sides = [("a", "left"), ("b", "right"), ("c", "right"), ("d", "left")]
    chassis = ChassisParameters.model_validate(
        {
            "track_width_m": 0.3,
            "wheels": [{"name": name, "side": side, "radius_m": 0.045} for name, side in sides],
        }
    )
    twist = Kinematics(chassis).saturate(Twist2D(linear_m_s, angular_rad_s), most_m_s)
    fastest = max(abs(linear_m_s + angular_rad_s * 0.15), abs(linear_m_s - angular_rad_s * 0.15))
    share = min(1.0, most_m_s / fastest) if fastest else 1.0
    assert math.isclose(twist.linear_m_s, linear_m_s * share, rel_tol=1e-9, abs_tol=1e-12)
    assert math.isclose(twist.angular_rad_s, angular_rad_s * share, rel_tol=1e-9, abs_tol=1e-12)


travels = st.floats(-0.2, 0.2) | st.sampled_from([0.0, 1e-9, -1e-5])


@given(
    st.lists(st.tuples(travels, travels), min_size=1, max_size=10),
    st.floats(-10, 10),
    st.floats(-math.pi, math.pi),
    st.floats(0.1, 1.0),
)
@settings(max_examples=examples(300))
def test_dead_reckoning(
    travel: list[tuple[float, float]], x_m: float, heading_rad: float, track_width_m: float
) -> None:
    """Any arcs, straight and on the spot, one after the other: the same bits of pose and covariance."""
    params, twist = OdometryParameters(), Twist2D(0.1, -0.2)
    covariance = PoseCovariance(1e-3, 1e-5, -1e-5, 2e-3, 1e-5, 1e-4)
    state = plain = OdometryState(Pose2D(x_m, -x_m / 3, heading_rad), twist, covariance)
    for left_m, right_m in travel:
        state = odometry.integrate(params, track_width_m, state, left_m, right_m, twist)
        plain = plain_odometry.integrate(params, track_width_m, plain, left_m, right_m, twist)
        assert state == plain


DRIVE = Drive(DriveParameters(max_rim_speed_m_s=0.5), CHASSIS, LIMITS, (RIG_GAINS, RIG_GAINS))
TWISTS = st.builds(Twist2D, st.sampled_from([0.0, 0.1, -0.2, 5.0]), st.sampled_from([0.0, 0.3, -2.0]))


@given(st.lists(st.tuples(TWISTS, st.integers(1, 40), st.booleans()), min_size=1, max_size=6), st.booleans())
@settings(max_examples=examples(100))
def test_setpoints_that_stay(asked: list[tuple[Twist2D, int, bool]], saturates: bool) -> None:
    """A twist that is asked for again and again, is reached, and changes: as if nothing had been remembered."""
    params, kinematics = DriveParameters(max_rim_speed_m_s=0.5), Kinematics(CHASSIS)
    one = Setpoints(params, LIMITS, kinematics)
    state = replace(DRIVE.at_rest, saturation_scale=0.8 if saturates else 1.0)
    now_s = 0.0
    for twist, steps, apart in asked:
        for _ in range(steps):
            now_s += 0.05
            plain = Setpoints(params, LIMITS, kinematics).step(state, twist, now_s, apart)
            state = one.step(state, twist, now_s, apart)
            assert state == plain
