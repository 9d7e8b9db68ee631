"""With less than 0.1 m to somebody who walks the robot creeps or stands unless the gap opens, and stands if touched."""

import numpy as np
import pytest

from benchmarks.passings import CREEPS_M_S, passed
from chefbotd.components.navigation.algorithms.brake_for_people import brake_for_people
from chefbotd.components.navigation.algorithms.evade import AGILE, Agility
from chefbotd.components.navigation.algorithms.grid import Singles
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.surroundings import Surroundings
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D

ROUND = Footprint(radius_m=0.18)
NO_MAP: Singles = np.full((100, 100), np.inf, np.float32)
DRIVES, CREEPS = Twist2D(0.25, 0.0), Twist2D(0.08, 0.0)

TOUCHED = (61, 97, 227, 306, 341, 355, 393, 515, 688, 799, 849, 870, 881, 997)
"""The passings in which a moving robot was touched before it braked so."""

FAST = (1, 197, 255, 405, 477, 680, 900)
"""Some in which it drove at 0.12 to 0.25 m/s with less than 0.1 m between them."""


def braked(
    x_m: float,
    y_m: float,
    velocity_m_s: tuple[float, float],
    *,
    last: Twist2D = DRIVES,
    twist: Twist2D = DRIVES,
    wish: Twist2D | None = None,
    walks: bool = True,
    agility: Agility = AGILE,
) -> Twist2D | None:
    """What a robot that drives so, and wants the same, is let do before a point that moves so."""
    near = Surroundings(
        np.array([[x_m, y_m]]), np.array([velocity_m_s]), np.array([0.11]), NO_MAP, 0.05, Pose2D(2, 2),
        speed_m_s=last.linear_m_s, is_walker=np.array([walks]),
    )  # fmt: skip
    return brake_for_people(ROUND, near, last, twist, wish, agility)


def test_a_robot_that_he_will_walk_into_drives_on_only_while_it_can_still_stand_before_he_is_within_5_cm() -> (
    None
):
    """He comes from the side at 1 m/s; from 0.25 m/s it stands in 0.31 s, and 0.08 s pass until it brakes.

    So 0.39 s are needed: 0.9 m leave 0.85 s until 5 cm, 0.4 m leave 0.35 s, which a little less speed makes up for,
    and 0.3 m leave 0.25 s.
    """
    assert braked(0.10, 0.18 + 0.90, (0.0, -1.0)) == DRIVES
    slower = braked(0.05, 0.18 + 0.40, (0.0, -1.0))
    assert slower is not None
    assert 0.20 < slower.linear_m_s < 0.25
    assert braked(0.05, 0.18 + 0.30, (0.0, -1.0)) == STANDING


def test_a_robot_whose_limits_let_it_brake_slowly_brakes_earlier() -> None:
    """With 0.3 m/s² it stands in 0.83 s, so 0.91 s are needed: 1.2 m leave 1.15 s, 0.75 m leave 0.7 s.

    With 0.2 m/s² it needs 1.33 s, more than it looks ahead otherwise: 1.2 m are too little, 1.6 m leave 1.55 s.
    """
    weak, weaker = Agility(0.3, 0.3), Agility(0.2, 0.2)
    assert braked(0.10, 0.18 + 1.20, (0.0, -1.0), agility=weak) == DRIVES
    slower = braked(0.10, 0.18 + 0.75, (0.0, -1.0), agility=weak)
    assert slower is not None
    assert slower.linear_m_s < 0.25
    assert braked(0.10, 0.18 + 0.75, (0.0, -1.0)) == DRIVES
    assert braked(0.10, 0.18 + 1.20, (0.0, -1.0), agility=weaker) != DRIVES
    assert braked(0.10, 0.18 + 1.60, (0.0, -1.0), agility=weaker) == DRIVES


def test_a_robot_that_creeps_drives_on_longer() -> None:
    """From 0.08 m/s it stands within 0.11 s: with 0.35 m between them it still creeps, with 0.15 m it stands."""
    assert braked(0.0, 0.18 + 0.35, (0.0, -1.0), last=CREEPS, twist=CREEPS) == CREEPS
    assert braked(0.0, 0.18 + 0.15, (0.0, -1.0), last=CREEPS, twist=CREEPS) == STANDING


def test_a_wish_that_keeps_him_10_cm_away_is_driven() -> None:
    """He crosses 0.35 m behind its middle, 0.17 m behind its back: he is no reason to brake."""
    assert braked(-0.35, 0.30, (0.0, -1.0), twist=CREEPS, wish=DRIVES) in (CREEPS, DRIVES)
    assert braked(-0.35, 0.30, (0.0, -1.0)) == DRIVES


def test_where_the_gap_opens_the_robot_may_be_fast() -> None:
    """He is 6 cm behind it and slower than it drives."""
    assert braked(-0.24, 0.0, (-0.05, 0.0)) == DRIVES


def test_a_robot_that_stands_does_not_set_out_before_he_has_passed() -> None:
    """He is 8 cm beside it and comes at 0.8 m/s."""
    assert braked(0.0, 0.26, (0.0, -0.8), last=Twist2D(0.03, 0.0), twist=Twist2D(0.05, 0.0)) == STANDING


def test_too_late_to_stand_it_takes_what_leaves_more_room() -> None:
    """0.15 s before he is there it cannot stand any more. Behind its middle he would be missed, or touched less deep."""
    assert braked(-0.12, 0.30, (0.0, -1.0), wish=DRIVES) == DRIVES
    assert braked(0.12, 0.25, (0.0, -1.0), wish=DRIVES) == STANDING


@pytest.mark.parametrize("y_m", [0.19, 0.3, 0.5])
def test_a_chair_that_only_seems_to_move_stops_nothing(y_m: float) -> None:
    """It is no person."""
    assert braked(0.0, y_m, (0.0, -1.0), walks=False) == DRIVES


@pytest.mark.parametrize("seed", [61, *FAST[:2]])
def test_who_yields_to_nothing_is_not_touched_by_a_robot_that_moves(seed: int) -> None:
    """In a corridor: no touch of a moving robot, and within 0.1 m no more than 0.1 m/s while the gap does not open."""
    passing = passed(seed)
    assert not passing.touches
    assert passing.fastest_m_s <= CREEPS_M_S


@pytest.mark.slow
@pytest.mark.parametrize("seed", [*TOUCHED[1:], *FAST[2:]])
def test_who_yielded_to_nothing_and_was_touched_is_not_touched_any_more(seed: int) -> None:
    """The other passings that once failed."""
    passing = passed(seed)
    assert not passing.touches
    assert passing.fastest_m_s <= CREEPS_M_S
