"""Who moves, and how fast, from scan to scan."""

import math

import numpy as np
import pytest

from chefbotd.navigation.movers import displaced, followed

ARC = np.stack([0.2 * np.cos(np.linspace(2, 4, 12)), 0.2 * np.sin(np.linspace(2, 4, 12))], axis=1)
CHAIR = np.array([[3.0, 1.0], [3.1, 1.05], [3.2, 1.1]])
NOISE = np.random.default_rng(3)


def walked(vx: float, vy: float, scans: int, *, noise_m: float = 0.01) -> np.ndarray:
    """The velocities of the last of some scans, ten a second: somebody who walks, then a chair."""
    movers: tuple[object, ...] = ()
    velocities = np.zeros((0, 2))
    for k in range(scans):
        person = ARC + np.array([1.0 + 0.1 * k * vx, -1.0 + 0.1 * k * vy])
        points = np.vstack([person, CHAIR])
        done = followed(movers, 5.0 + 0.1 * k, points + NOISE.normal(0, noise_m, points.shape))
        movers, velocities = done.movers, done.velocity_m_s
    return velocities


def test_somebody_who_walks_has_his_velocity_and_a_chair_has_none() -> None:
    """0.5 m/s to the left and a little back, within 0.1 m/s, in spite of a centimetre of noise; the chair stands."""
    velocities = walked(-0.2, 0.46, 8)
    assert velocities[: len(ARC)] == pytest.approx(np.tile([-0.2, 0.46], (len(ARC), 1)), abs=0.1)
    assert not velocities[len(ARC) :].any()


def test_a_moment_is_not_enough_to_say_that_somebody_walks() -> None:
    """Three scans are 0.2 s: nothing yet; after five there is."""
    assert not walked(0.5, 0.0, 3).any()
    assert walked(0.5, 0.0, 5)[: len(ARC)].any()


def test_who_stands_for_half_a_second_has_stopped() -> None:
    """His velocity is that of the last half second, not of all his way."""
    movers: tuple[object, ...] = ()
    for k in range(16):
        along_m = 0.06 * min(k, 8)
        done = followed(movers, 0.1 * k, ARC + np.array([1.0 + along_m, 0.0]))
        movers = done.movers
    assert not done.velocity_m_s.any()


def test_no_points_are_nobody_and_what_is_wide_does_not_walk() -> None:
    """A wall's middle moves with what is seen of it."""
    assert followed((), 1.0, np.zeros((0, 2))).velocity_m_s.shape == (0, 2)
    movers: tuple[object, ...] = ()
    for k in range(8):
        wall = np.stack([np.linspace(0.2 * k, 2.0 + 0.2 * k, 30), np.full(30, 2.0)], axis=1)
        done = followed(movers, 0.1 * k, wall)
        movers = done.movers
    assert math.isclose(float(np.abs(done.velocity_m_s).max()), 0.0)


def test_who_went_half_a_metre_is_a_walker_for_ten_seconds_after_his_last_step() -> None:
    """At 0.5 m/s that is after 1.1 s; he stands from 2 s on. What is seen of a chair shifts by 0.3 m, and is none."""
    movers: tuple[object, ...] = ()
    seen = {}
    for k in range(140):
        person = ARC + np.array([1.0 + 0.05 * min(k, 20), 0.0])
        chair = CHAIR + np.array([0.0, 0.04 * min(k, 7)])
        done = followed(movers, 0.1 * k, np.vstack([person, chair]))
        movers, seen[k] = done.movers, done.is_walker
    assert not seen[9].any()
    assert seen[12][: len(ARC)].all()
    assert seen[110][: len(ARC)].all()
    assert not seen[130].any()
    assert not any(flags[len(ARC) :].any() for flags in seen.values())


@pytest.mark.parametrize("gap_s", [0.5, 1.0, 1.4])
def test_who_was_not_seen_for_a_moment_walks_on(gap_s: float) -> None:
    """A walker at -0.4 m/s and 0.3 m/s that no scan shows for a while has his velocity at the first scan after it."""
    movers: tuple[object, ...] = ()
    times = [0.1 * k for k in range(20)] + [1.9 + gap_s]
    for now_s in times:
        done = followed(movers, now_s, ARC + np.array([1.0 - 0.4 * now_s, 0.3 * now_s]))
        movers = done.movers
    assert done.velocity_m_s == pytest.approx(np.tile([-0.4, 0.3], (len(ARC), 1)), abs=0.02)
    assert done.is_walker.all()


def test_a_pose_that_jumps_gives_nobody_another_velocity() -> None:
    """All that is seen jumps by 0.2 m: he walks on as before, and the chair stands."""
    movers: tuple[object, ...] = ()
    for k in range(26):
        if k == 20:
            movers = displaced(movers)
        jump = np.array([0.2, 0.05]) if k >= 20 else 0.0
        person = ARC + np.array([1.0 + 0.03 * k, -1.0])
        done = followed(movers, 0.1 * k, np.vstack([person, CHAIR]) + jump)
        movers = done.movers
        if k >= 10:
            velocity = done.velocity_m_s
            assert velocity[: len(ARC)] == pytest.approx(np.tile([0.3, 0.0], (len(ARC), 1)), abs=0.01)
            assert not velocity[len(ARC) :].any()
