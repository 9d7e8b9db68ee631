"""Which recognised places are believed: the sure ones at once, the others when enough of them agree."""

import numpy as np
import pytest

from chefbotd.components.mapping.algorithms.loops import accept_candidates, is_sound
from chefbotd.components.mapping.algorithms.parameters import LoopParameters
from chefbotd.components.mapping.algorithms.refine import Fit
from chefbotd.components.mapping.algorithms.state import Candidate, Nodes, Scan, SlamMode, SlamState, start
from chefbotd.core.record import replace

LOOPS = LoopParameters()
NOTHING = Scan(np.zeros((0, 2), np.float32), np.zeros((0, 2), np.float32), np.zeros(2))


def at(
    path_m: list[float], waiting: tuple[Candidate, ...] = (), mode: SlamMode = SlamMode.MAPPING
) -> SlamState:
    """A robot that kept a scan at each of these ways, all 3 m ahead of the map's origin."""
    count = len(path_m)
    poses = np.tile([3.0, 0.0, 0.0], (count, 1))
    numbers, zeros = np.arange(count), np.zeros(count, np.int64)
    nodes = Nodes(numbers, np.array(path_m), poses, poses, np.array(path_m), zeros, (NOTHING,) * count)
    return replace(start(), nodes=nodes, path_m=path_m[-1], candidates=waiting, mode=mode)


def candidate(node: int, correction: tuple[float, float, float], drift_m: float = 1.0) -> Candidate:
    """Somebody says at this node that the map should be moved so."""
    return Candidate(node, 0, np.zeros(3), np.eye(3), np.array(correction), drift_m)


def test_a_match_is_believed_at_once_where_little_has_drifted() -> None:
    """Under 0.3 m of drift there is no doubt which place it is."""
    sure = candidate(1, (0.1, 0.0, 0.0), drift_m=0.2)
    assert accept_candidates(LOOPS, at([0.0, 1.0]), (sure,)) == ((sure,), ())


def test_a_lone_match_after_a_long_way_waits() -> None:
    """It may be a room that looks the same."""
    alone = candidate(1, (1.0, 0.0, 0.0))
    assert accept_candidates(LOOPS, at([0.0, 1.0]), (alone,)) == ((), (alone,))


def test_two_that_agree_are_both_believed() -> None:
    """A correction of 1 m ahead and one of 1.2 m ahead are 0.2 m apart where the robot is."""
    first, second = candidate(0, (1.0, 0.0, 0.0)), candidate(1, (1.2, 0.0, 0.01))
    accepted, waiting = accept_candidates(LOOPS, at([0.0, 1.0], (first,)), (second,))
    assert set(map(id, accepted)) == {id(first), id(second)}
    assert waiting == ()


def test_agreement_is_judged_where_the_robot_is() -> None:
    """Both move the origin alike, but 0.2 rad make 0.6 m of difference 3 m ahead."""
    first, second = candidate(0, (1.0, 0.0, 0.0)), candidate(1, (1.0, 0.0, 0.2))
    assert accept_candidates(LOOPS, at([0.0, 1.0], (first,)), (second,))[0] == ()


def test_two_matches_from_one_place_are_one_opinion() -> None:
    """The same scan in two overlapping submaps proves nothing."""
    first, second = candidate(1, (1.0, 0.0, 0.0)), candidate(1, (1.0, 0.0, 0.0))
    assert accept_candidates(LOOPS, at([0.0, 1.0]), (first, second))[0] == ()


def test_rivals_must_be_outvoted() -> None:
    """With one that asks for something else, two are too few, and three are enough."""
    rival, first = candidate(0, (-3.0, 0.0, 0.0)), candidate(1, (1.0, 0.0, 0.0))
    second, third = candidate(2, (1.0, 0.1, 0.0)), candidate(3, (1.0, 0.0, 0.0))
    assert accept_candidates(LOOPS, at([0.0, 1.0, 2.0], (rival, first)), (second,))[0] == ()
    accepted, waiting = accept_candidates(LOOPS, at([0.0, 1.0, 2.0, 3.0], (rival, first, second)), (third,))
    assert len(accepted) == 3
    assert waiting == (rival,)


def test_a_lost_robot_needs_three() -> None:
    """There is no drift to tell where it can be, so it takes one more."""
    first, second, third = (candidate(k, (1.0, 0.0, 0.0)) for k in range(3))
    assert accept_candidates(LOOPS, at([0.0, 1.0], (first,), SlamMode.LOST), (second,))[0] == ()
    found, _ = accept_candidates(LOOPS, at([0.0, 1.0, 2.0], (first, second), SlamMode.LOST), (third,))
    assert len(found) == 3


def test_old_matches_are_dropped() -> None:
    """After 15 m nobody waits any more."""
    first, second = candidate(0, (1.0, 0.0, 0.0)), candidate(1, (1.0, 0.0, 0.0))
    assert accept_candidates(LOOPS, at([0.0, 15.5], (first,)), (second,)) == ((), (second,))


def fit(points: int = 100, known: int = 90, inliers: int = 80, x_m: float = 0.0) -> Fit:
    """A match of so many points."""
    return Fit(np.array([x_m, 0.0, 0.0]), np.eye(3), points, known, inliers, 0, 0.02)


@pytest.mark.parametrize(
    ("found", "sound"),
    [
        (fit(), True),
        (fit(inliers=67), False),
        (fit(known=49, inliers=49), False),
        (fit(x_m=0.19), True),
        (fit(x_m=0.21), False),
    ],
    ids=["good", "too few fit", "too little overlap", "polished within 0.2 m", "ran away"],
)
def test_a_match_must_be_sound(found: Fit, sound: bool) -> None:
    """Three quarters of what is on known ground must fit, half of the scan must be there, and polish stays near."""
    assert is_sound(LOOPS, found, np.zeros(3)) is sound
