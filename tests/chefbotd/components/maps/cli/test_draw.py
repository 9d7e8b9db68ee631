"""Maps drawn in a terminal: small ones by hand, and whatever the size of map and terminal."""

import math

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from chefbotd.components.maps.cli.draw import FOG, FULL, LOWER, UPPER, MapMark, draw_map
from chefbotd.core.geometry import ORIGIN, Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid


def grid(rows: list[list[int]], origin: Pose2D = ORIGIN, resolution_m: float = 0.1) -> OccupancyGrid:
    """A grid of these percentages, the top row first, as it is drawn."""
    return OccupancyGrid(resolution_m, origin, np.flipud(np.array(rows, np.int8)).copy())


def plain(*args: object, **kwargs: object) -> list[str]:
    """The drawn lines without colours."""
    return draw_map(*args, color=False, **kwargs).plain.split("\n")  # type: ignore[arg-type]


L_SHAPED = grid([[100, 100, 100, 0], [100, 0, 0, 0], [100, 0, 0, 0], [-1, -1, -1, 100]])


def test_two_cells_share_a_character_and_the_first_row_is_the_lowest() -> None:
    """A wall at the left and above, something at the lower right, and nothing seen at the lower left."""
    assert plain(L_SHAPED, 80, 24) == [f"{FULL}{UPPER}{UPPER} ", f"{UPPER}  {LOWER}"]


def test_what_nobody_saw_is_shaded_and_cut_off_around_the_map() -> None:
    """Of nine by nine cells with one wall, three by three are drawn, and an unseen row above them."""
    percent = np.full((9, 9), -1, np.int8)
    percent[2, 6] = 100
    assert plain(OccupancyGrid(0.1, Pose2D(), percent), 80, 24) == [FOG * 3, f"{FOG}{UPPER}{FOG}"]


def test_a_map_where_nothing_is_known_is_drawn_all_the_same() -> None:
    """As fog."""
    assert plain(grid([[-1, -1], [-1, -1]]), 80, 24) == [FOG * 2]


def test_a_wall_of_one_cell_stays_when_a_large_map_is_drawn_small() -> None:
    """One column of 300 in ten characters."""
    percent = np.zeros((180, 300), np.int8)
    percent[:, 151] = 100
    lines = plain(OccupancyGrid(0.05, Pose2D(), percent), 10, 24)
    assert {line.index(FULL) for line in lines} == {5}
    assert all(line.count(FULL) == 1 and len(line) == 10 for line in lines)


def test_a_mark_stands_where_it_is_in_a_map_whose_origin_is_turned() -> None:
    """The origin lies at (2, -3), turned by 90 degrees: a point 0.25 m along its x and 0.35 m along its y."""
    origin = Pose2D(2.0, -3.0, math.pi / 2)
    free = grid([[0] * 6] * 6, origin)
    at = origin.compose(Pose2D(0.25, 0.35, math.pi / 4))
    lines = plain(free, 80, 24, [MapMark(at.x_m, at.y_m, at.heading_rad)])
    assert lines == ["      ", "  ↗   ", "      "]


def test_a_label_is_cut_at_the_edge_and_a_mark_outside_is_left_out() -> None:
    """Neither makes a line longer; what cannot be printed in a name is left out."""
    free = grid([[0] * 6] * 2)
    marks = [MapMark(0.35, 0.05, label="kit\nchen"), MapMark(9.0, 0.05, label="far"), MapMark(math.nan, 0.0)]
    assert plain(free, 80, 24, marks) == ["   ●ki"]


def test_in_colour_each_half_has_its_own() -> None:
    """Upper halves in the colour of the upper cell, on the colour of the lower one."""
    text = draw_map(grid([[100, 0], [0, -1]]), 80, 24)
    assert text.plain == UPPER * 2
    assert [str(span.style) for span in text.spans] == ["black on grey85", "grey85 on grey30"]


@example(17, 17, 7, 4, 0)  # 17 / (17 / 7) is a little more than 7
@given(st.integers(1, 70), st.integers(1, 70), st.integers(1, 40), st.integers(1, 20), st.integers(0, 99))
def test_every_map_fits_every_terminal(height: int, width: int, columns: int, rows: int, seed: int) -> None:
    """All lines are equally long, and no more of them than there is room for, with a mark in every corner."""
    rng = np.random.default_rng(seed)
    percent = rng.choice(np.array([-1, 0, 40, 100], np.int8), (height, width))
    marks = [
        MapMark(x, y, label="place") for x in (0.0, width * 0.05 - 0.01) for y in (0.0, height * 0.05 - 0.01)
    ]
    lines = plain(OccupancyGrid(0.05, Pose2D(), percent), columns, rows, marks)
    assert 1 <= len(lines) <= rows
    assert len({len(line) for line in lines}) == 1
    assert 1 <= len(lines[0]) <= columns
