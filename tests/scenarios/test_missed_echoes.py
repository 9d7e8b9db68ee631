"""Robots whose range sensors miss are driven at a wall: no contact, no creeping, and a free way is believed in time."""

import pytest

from benchmarks import missed_echoes

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("misses", ["fifth", "half", "every_second", "bursts_of_three", "far_half"])
@pytest.mark.parametrize("board", ["classic, not silent", "our firmware"])
def test_it_stands_before_the_wall_and_does_not_creep(board: str, misses: str) -> None:
    """After a minute it stands, moves by nothing in 40 s more, and goes on within 1.5 s of a way that became free."""
    got = missed_echoes.measure(missed_echoes.settings_of(board, misses))
    assert not got.touched
    assert got.crept_m == 0.0
    assert got.went_on_s <= 1.5


@pytest.mark.parametrize("misses", ["twentieth", "fifth", "half", "bursts_of_three"])
def test_a_board_that_is_silent_at_each_miss_touches_nothing(misses: str) -> None:
    """A second without a reading, and a command that is obeyed up to two seconds late: no contact."""
    assert not missed_echoes.measure(
        missed_echoes.settings_of("classic, silent for a second", misses)
    ).touched


@pytest.mark.parametrize("glitches", ["fifth", "half"])
def test_an_infrared_sensor_that_glitches(glitches: str) -> None:
    """KHAN before the cupboard."""
    got = missed_echoes.measure(missed_echoes.khan(glitches))
    assert not got.touched
    assert got.crept_m == 0.0
