"""Close to somebody who walks the robot creeps or stands, unless it makes way."""

import math

import numpy as np
import pytest

from benchmarks.passings import passed
from chefbotd.components.navigation.algorithms.beside_people import slowed_beside_people
from chefbotd.components.navigation.algorithms.grid import Singles
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.core.geometry import Pose2D, Twist2D

ROUND = Footprint(radius_m=0.18)
NO_MAP: Singles = np.full((100, 100), np.inf, np.float32)
DRIVES = Twist2D(0.25, 0.0)


def speed_beside(x_m: float, y_m: float, velocity_m_s: tuple[float, float]) -> float:
    """How fast a robot that wants 0.25 m/s may be beside a point of somebody who walks so."""
    points, velocity = np.array([[x_m, y_m]]), np.array([velocity_m_s])
    near = Surroundings(points, velocity, np.array([0.11]), NO_MAP, 0.05, Pose2D(2, 2))
    twist = slowed_beside_people(ROUND, near, DRIVES)
    assert twist is not None
    return twist.linear_m_s


@pytest.mark.parametrize(
    ("gap_m", "most_m_s", "least_m_s"),
    [(0.02, 0.0, 0.0), (0.065, 0.05, 0.03), (0.099, 0.08, 0.075), (0.3, 0.25, 0.25)],
)
def test_beside_somebody_who_walks_along_with_it_the_robot_is_slower_the_nearer_he_is(
    gap_m: float, most_m_s: float, least_m_s: float
) -> None:
    """He walks slowly on ahead at its side: at 2 cm it stands, at 10 cm it creeps at 0.08 m/s, at 30 cm it drives."""
    assert least_m_s - 1e-6 <= speed_beside(0.0, 0.18 + gap_m, (0.19, 0.0)) <= most_m_s + 1e-6


def test_it_slows_down_before_he_is_close() -> None:
    """He closes the gap of 0.3 m at 0.5 m/s: in 0.4 s there are 0.1 m."""
    assert 0.08 < speed_beside(0.0, 0.48, (0.0, -0.25)) <= 0.25
    assert speed_beside(0.0, 0.40, (0.0, -0.5)) < 0.25


def test_it_goes_on_where_that_opens_the_gap() -> None:
    """He comes from behind, slower than it drives: standing would be worse."""
    assert speed_beside(-0.26, 0.0, (0.2, 0.0)) == pytest.approx(0.25)


def test_it_stands_where_neither_helps() -> None:
    """He walks over it from behind at 1 m/s."""
    assert speed_beside(-0.30, 0.0, (1.0, 0.0)) < 0.14
    assert speed_beside(-0.20, 0.0, (1.0, 0.0)) == 0.0


def test_it_creeps_out_of_the_way_of_somebody_who_may_graze_it() -> None:
    """He walks across behind its back, 0.19 m from its middle, so 1 cm clear of a robot that stands: it creeps on."""
    assert 0.07 < speed_beside(-0.19, 0.30, (0.0, -1.0)) <= 0.25


def test_it_goes_on_out_of_the_way_of_somebody_who_surely_grazes_it() -> None:
    """He would walk 5 cm into a robot that stands, and passes it 4 cm behind where it drives on: 0.12 m/s at least."""
    assert 0.12 - 1e-6 <= speed_beside(-0.13, 0.40, (0.0, -1.0)) <= 0.25


def test_it_stands_for_somebody_who_walks_right_over_it() -> None:
    """He comes from the side, 18 cm into a robot that stands: going on would not save it."""
    assert speed_beside(0.0, 0.25, (0.0, -1.0)) < 0.14


def test_somebody_who_surely_touches_a_robot_that_stands_is_evaded_at_full_speed() -> None:
    """He walks 9 cm into a robot that stands, and seems to graze one that drives on by 1.5 cm: slower it is more."""
    assert speed_beside(-0.09, 0.30, (0.0, -1.0)) == pytest.approx(0.25)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 11])
def test_nobody_who_does_not_yield_is_passed_fast_or_touched_by_a_robot_that_moves(seed: int) -> None:
    """In a corridor and out of a door; the whole study is ``python -m benchmarks passings``."""
    run = passed(seed, until_reached=True)
    assert run.is_reached
    assert not run.touches
    assert run.fast_s < 0.2
    assert math.isfinite(run.moving_m)
