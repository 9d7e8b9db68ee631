"""What the Duemilanove's image can carry, and how soon it stops: in simavr, on the cycle."""

import math

import pytest

from tests.firmware import limits


def test_the_image_is_small() -> None:
    """Static RAM is 1.2 KB at most of the part's 2, flash 14.5 KB of its 32."""
    assert limits.static_bytes() <= 1_200
    assert limits.flash_bytes() <= 14.5 * 1024


@pytest.mark.parametrize(
    ("how", "cause"), [(1, 6), (2, 4), (3, 4)], ids=["hangs", "hangs with interrupts shut", "hangs, no tick"]
)
def test_a_main_loop_that_hangs_is_restarted(how: int, cause: int) -> None:
    """The motors are off and the banner begins within 0.3 s, with cause 6 (seen by the tick) or 4 (the watchdog)."""
    off_s, banner_s, board = limits.hang(how)
    assert off_s <= 0.3
    assert banner_s <= 0.3
    assert f"firmware\t1\t0\t1\t1\t15\t{cause}" in board.lines


def test_the_dead_man_stops_at_whatever_moment_the_host_falls_silent() -> None:
    """100 silences of 100, in a line, a cycle or a turn: 0 on the pins 0.25 to 0.26 s after the last whole line."""
    took_s = limits.silences_s(100)
    assert len(took_s) == 100
    assert 0.249 <= min(took_s) <= max(took_s) <= 0.26


def test_the_processor_is_idle_half_of_the_time_in_its_busiest_tenth_of_a_second() -> None:
    """With 23,200 edges and 50 duties a second, and every sensor: 50 % at most of any 0.1 s."""
    assert limits.busiest_share(3.0) <= 0.5


def test_no_edge_is_lost_in_a_long_drive() -> None:
    """0 of 100,000 (a benchmark has 10^6), with duties, echoes and readings between."""
    assert limits.lost_edges(100_000, "s 120 -80") == 0


def test_no_edge_is_lost_where_the_wheel_loop_begins_and_its_parameters_change() -> None:
    """At full speed: its divisions do not shut the interrupts out."""
    assert limits.lost_edges(50_000, "s 120 -80", "w 8000 -8000", "g 0 8400", "g 7 300") == 0


@pytest.mark.parametrize("edges_s", [1_400, 6_000, 11_000])
def test_the_wheel_loop_sees_wheels_that_turn_evenly_turn_evenly(edges_s: int) -> None:
    """Within a twentieth: an edge's time is right also where the millisecond has just begun."""
    assert limits.unevenness_rad_s(edges_s, 5.0) <= 0.05 * edges_s / limits.COUNTS_PER_TURN * math.tau


def test_the_cycles_begin_evenly() -> None:
    """Two cycles are 10 ms apart, within 0.2 ms."""
    assert limits.jitter_us() <= 200


def test_the_stack_leaves_room() -> None:
    """256 bytes at most were ever used."""
    assert limits.stack_bytes() <= 256


def test_a_command_reaches_the_drivers_soon() -> None:
    """12 ms at the 99th percentile of 300 lines, the 1.6 ms on the wire included."""
    assert sorted(limits.commands_s(300))[296] <= 0.012
