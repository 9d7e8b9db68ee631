"""What is thought of a goal that was reached, when the pose is doubted afterwards, or found to be elsewhere."""

import pytest

from chefbotd.components.navigation.algorithms.arrival import (
    MOST_WAY_M,
    Arrival,
    ArrivalData,
    ArrivalState,
    begin_arrival,
    watch_arrival,
)
from chefbotd.core.geometry import Pose2D

WEST = Pose2D(1.0, 2.0, 0.0)
"""How the robot was placed in the map at the goal."""

EAST = Pose2D(4.0, 2.0, 0.0)
"""The same, 3 m farther east."""

THEN = Pose2D(0.5, 0.0, 0.0)


def seen(
    arrival: Arrival, now_s: float, placed: Pose2D | None, odometry: Pose2D = THEN, state: str = "localized"
) -> tuple[Arrival | None, ArrivalData | None]:
    """One step in a state of localization."""
    return watch_arrival(
        arrival, now_s, placed, odometry, is_sure=state == "localized", is_uncertain=state == "uncertain"
    )


def test_a_pose_that_is_found_elsewhere_after_a_search_tells_where_the_robot_stood_when_it_took_itself_for_there() -> (
    None
):
    """It drove 0.4 m on, then was found 3 m farther east: it stood at 4 + 0.5 m."""
    arrival, first = seen(begin_arrival(7, WEST, THEN), 1.0, WEST)
    assert first is None
    assert arrival is not None
    on = Pose2D(0.9, 0.0, 0.0)
    arrival, doubted = seen(arrival, 5.0, None, on, "searching")
    assert doubted is not None
    assert (doubted.goal, doubted.arrival, doubted.off_m) == (7, ArrivalState.DOUBTED, None)
    assert arrival is not None
    arrival, wrong = seen(arrival, 9.0, EAST, on)
    assert arrival is None
    assert wrong is not None
    assert wrong.arrival is ArrivalState.WRONG
    assert (wrong.off_m, wrong.x_m, wrong.y_m) == pytest.approx((3.0, 4.5, 2.0))
    assert "was not at its goal, but at (4.50, 2.00), 3.00 m from where it took itself to be" in wrong.reason


def test_a_pose_that_jumps_without_a_doubt_tells_it_as_well() -> None:
    """A person says where the robot is, and the scans agree at once."""
    _, wrong = seen(begin_arrival(1, WEST, THEN), 1.0, EAST)
    assert wrong is not None
    assert wrong.arrival is ArrivalState.WRONG


def test_a_moment_of_uncertainty_is_no_doubt_and_a_longer_one_is_taken_back() -> None:
    """1.9 s say nothing; 2.1 s are told once, and that the pose was right after all."""
    arrival: Arrival | None = begin_arrival(1, WEST, THEN)
    told = list[ArrivalData | None]()
    for now_s, state in ((1.0, "uncertain"), (2.9, "uncertain"), (3.0, "localized"), (4.0, "uncertain")):
        assert arrival is not None
        arrival, data = seen(arrival, now_s, WEST, state=state)
        told.append(data)
    assert told == [None] * 4
    for now_s, state, expected in (
        (6.1, "uncertain", ArrivalState.DOUBTED),
        (7.0, "uncertain", None),
        (8.0, "localized", ArrivalState.CONFIRMED),
        (9.0, "localized", None),
    ):
        assert arrival is not None
        arrival, data = seen(arrival, now_s, WEST, state=state)
        assert (data.arrival if data else None) is expected


def test_odometry_that_drifts_and_is_corrected_all_the_way_is_no_wrong_pose() -> None:
    """A metre in 25 m, 2 cm at a time; after 30 m the arrival is watched no more."""
    arrival: Arrival | None = begin_arrival(1, WEST, THEN)
    for k in range(1, 51):
        assert arrival is not None
        arrival, data = seen(arrival, 2.0 * k, Pose2D(1.0 + 0.02 * k, 2.0), Pose2D(0.5 + 0.5 * k, 0.0))
        assert data is None
    assert arrival is not None
    arrival, data = seen(arrival, 200.0, Pose2D(2.0, 2.0), Pose2D(0.6 + MOST_WAY_M, 0.0))
    assert (arrival, data) == (None, None)
