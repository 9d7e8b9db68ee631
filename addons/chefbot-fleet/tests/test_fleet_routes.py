"""Routes in the time that others leave. An edge takes two seconds."""

import math

from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace, Reservations, Step, Stop, route


def times(steps: tuple[Step, ...] | None) -> list[tuple[int, float, float]]:
    """Target, start and end of each step."""
    assert steps is not None
    return [(step.target, step.start_s, step.end_s) for step in steps]


def test_the_shortest_route_on_an_empty_map(corridor: Roadmap, pace: Pace) -> None:
    """Four metres from time 10 on."""
    steps = route(corridor, Reservations.none(corridor), pace, 0, 10.0, (Stop(4),))
    assert times(steps) == [(1, 10, 12), (2, 12, 14), (3, 14, 16), (4, 16, 18)]


def test_work_at_a_stop_takes_its_time(corridor: Roadmap, pace: Pace) -> None:
    """To the passing place, three seconds of work, and back to 2."""
    steps = route(corridor, Reservations.none(corridor), pace, 2, 0.0, (Stop(5, 3.0), Stop(2)))
    assert times(steps) == [(5, 0, 2), (2, 5, 7)]
    assert steps is not None
    assert [step.stops_done for step in steps] == [0, 1]


def test_a_robot_waits_where_it_is_until_the_corridor_is_free(corridor: Roadmap, pace: Pace) -> None:
    """Edge 1-2 is used from 1 to 7, and with it 0-1, which is too near: so it leaves at 7."""
    reserved = Reservations.none(corridor)
    reserved.pass_along(corridor, 1, (1.0, 7.0))
    assert times(route(corridor, reserved, pace, 0, 0.0, (Stop(2),))) == [(1, 7, 9), (2, 9, 11)]


def test_a_robot_in_the_way_yields_to_the_passing_place_and_comes_back(corridor: Roadmap, pace: Pace) -> None:
    """Somebody comes from 4 to 0 between 4 and 12: from 2 the route to 4 leads by 5, until edge 1-2 is over."""
    reserved = Reservations.none(corridor)
    for number, edge in enumerate((3, 2, 1, 0)):
        reserved.pass_along(corridor, edge, (4.0 + 2 * number, 6.0 + 2 * number))
    steps = route(corridor, reserved, pace, 2, 0.0, (Stop(4),))
    assert times(steps) == [(5, 0, 2), (2, 10, 12), (3, 12, 14), (4, 14, 16)]


def test_the_last_stop_must_stay_free_for_ever(corridor: Roadmap, pace: Pace) -> None:
    """Somebody comes by node 4 at 100: the robot lets it pass before it arrives for good."""
    reserved = Reservations.none(corridor)
    reserved.stay(corridor, 4, (100.0, 110.0))
    steps = route(corridor, reserved, pace, 0, 0.0, (Stop(4),))
    assert steps is not None
    assert steps[-1].start_s >= 110.0


def test_there_is_no_route_to_a_place_that_is_kept(corridor: Roadmap, pace: Pace) -> None:
    """Nor through one."""
    reserved = Reservations.none(corridor)
    reserved.stay(corridor, 3, (0.0, math.inf))
    assert route(corridor, reserved, pace, 0, 0.0, (Stop(4),)) is None


def test_there_is_no_route_from_a_place_that_is_another_s_by_now(corridor: Roadmap, pace: Pace) -> None:
    """The caller keeps the plan that it has."""
    reserved = Reservations.none(corridor)
    reserved.pass_along(corridor, 0, (-1.0, 3.0))
    assert route(corridor, reserved, pace, 0, 0.0, (Stop(4),)) is None


def test_a_trip_that_ends_where_it_begins_needs_no_step(corridor: Roadmap, pace: Pace) -> None:
    """An empty plan is a plan."""
    assert route(corridor, Reservations.none(corridor), pace, 0, 0.0, (Stop(0, 5.0), Stop(0))) == ()
