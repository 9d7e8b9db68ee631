"""A few of the random drives of ``healthy_drives``; the whole is run by hand, N of them."""

import pytest

from tests.scenarios.healthy_drives import run_robot


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 5])
def test_a_healthy_robot_is_not_accused_where_echoes_come_and_go(seed: int) -> None:
    """Three drives each, by hand or to goals, with sketches, loads and halls as the seed draws them."""
    driven = run_robot(seed, drives=3)
    assert driven.drives == 3
    assert driven.found == []


@pytest.mark.slow
def test_a_robot_that_starts_in_a_silent_hall_is_not_said_to_be_off_its_target() -> None:
    """Half as heavy again, on a board that gives a reading a second: it reaches its speed after the third one."""
    assert run_robot(23).found == []
