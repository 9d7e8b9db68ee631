"""Localization on a map that is edited in use: what was erased is gone for it, and drawn walls are not there."""

import math

import numpy as np
import pytest

from chefbotd.components.localization.edited_map import edited_map
from chefbotd.components.localization.skill_requests import UseEdits, UseMap
from chefbotd.components.map_edits.edit_file import (
    NO_EDITS,
    DrawWall,
    Erase,
    MapEdit,
    with_edit,
    with_view_angle,
    write_edits,
)
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.occupancy_grid import OccupancyGrid
from tests.chefbotd.components.localization.test_skill import FLAT, TRUTH, Bench, off_m

X_M, Y_M = map(float, TRUTH[40][:2])
BOX_M = ((X_M - 0.3, Y_M - 0.3), (X_M + 0.3, Y_M - 0.3), (X_M + 0.3, Y_M + 0.3), (X_M - 0.3, Y_M + 0.3))


def edits(*drawn: MapEdit) -> bytes:
    """The file's content with these edits."""
    now = NO_EDITS
    for number, edit in enumerate(drawn):
        now = with_edit(now, str(number), edit)
    return write_edits(now)


def grid_of(bench: Bench) -> OccupancyGrid:
    """The cells by which the way is found."""
    assert bench.skill.edited is not None
    return bench.skill.edited.grid


def on_the_flat() -> Bench:
    """A robot that knows where it is."""
    bench = Bench()
    bench.ask(UseMap("flat", 1))
    bench.drive(0, 40)
    assert bench.told[-1].state == "localized"
    return bench


def test_a_wall_that_is_drawn_across_the_scans_changes_nothing_of_the_fit() -> None:
    """Walls that are not there all round the robot: the same cells are matched, the same objects, the same pose."""
    bench = on_the_flat()
    edited, grid = bench.skill.edited, grid_of(bench)
    bench.edits = edits(DrawWall(points_m=(*BOX_M, BOX_M[0]), width_m=0.1))
    assert bench.ask(UseEdits()).state == "localized"
    assert grid_of(bench) is grid
    assert bench.skill.edited is not edited
    assert bench.skill.edited is not None
    assert bench.skill.edited.closed is not None
    bench.drive(41, 60)
    assert {told.state for told in bench.told[-20:]} == {"localized"}
    assert off_m(bench, 60) < 0.03


def test_a_pose_stays_where_a_part_of_the_map_is_erased_and_is_found_again_in_what_is_left() -> None:
    """The left third of the flat becomes unknown; a robot in the rest of it stays localized within 5 cm."""
    bench = on_the_flat()
    left_m = FLAT.map_from_grid.x_m
    wide_m, high_m = (count * FLAT.resolution_m for count in reversed(FLAT.percent.shape))
    far_m = left_m + wide_m if left_m + wide_m / 2 > X_M else left_m
    near_m = far_m - math.copysign(wide_m / 3, far_m - X_M)
    low_m = FLAT.map_from_grid.y_m
    corners = ((near_m, low_m), (far_m, low_m), (far_m, low_m + high_m), (near_m, low_m + high_m))
    bench.edits = edits(Erase(to="unknown", points_m=corners))
    used = bench.skill.used
    assert bench.ask(UseEdits()).state == "localized"
    assert bench.skill.used is used
    assert (grid_of(bench).percent == -1).sum() > (FLAT.percent == -1).sum()
    bench.drive(41, 60)
    assert {told.state for told in bench.told[-20:]} == {"localized"}
    assert off_m(bench, 60) < 0.05
    bench.edits = None
    bench.ask(UseEdits())
    assert np.array_equal(grid_of(bench).percent, FLAT.percent)


def test_edits_that_cannot_be_read_leave_the_map_as_it_was_in_use() -> None:
    """And one that is loaded with them is not used at all, because it is not known where walls were drawn."""
    bench = on_the_flat()
    edited = bench.skill.edited
    bench.edits = b"{"
    with pytest.raises(
        Refused, match=r"the map is used as it was before it was edited: edits\.json"
    ) as refused:
        bench.ask(UseEdits())
    assert refused.value.kind is RefusalKind.MAP_UNREADABLE
    assert bench.skill.edited is edited
    with pytest.raises(Refused, match=r"'flat' cannot be used for localization: edits\.json"):
        bench.ask(UseMap("flat", 2))
    assert bench.skill.used is None


def test_a_map_whose_walls_are_all_erased_is_used_as_before() -> None:
    """There would be nothing to find the way by."""
    bench = on_the_flat()
    x_m, y_m = FLAT.map_from_grid.x_m - 1, FLAT.map_from_grid.y_m - 1
    everything = ((x_m, y_m), (x_m + 99, y_m), (x_m + 99, y_m + 99), (x_m, y_m + 99))
    bench.edits = edits(Erase(to="free", points_m=everything))
    with pytest.raises(Refused, match="before it was edited: a map for localization needs walls"):
        bench.ask(UseEdits())
    bench.drive(41, 45)
    assert bench.told[-1].state == "localized"


def test_edits_without_a_map_and_turned_views_change_nothing() -> None:
    """Without a map in use there is nothing to do; an angle of the view is nothing that is driven by."""
    bench = Bench()
    bench.edits = edits(Erase(to="free", points_m=BOX_M))
    assert bench.ask(UseEdits()).state == "unknown"
    turned = edited_map(FLAT, write_edits(with_view_angle(NO_EDITS, 0.3)))
    assert turned.grid is FLAT
    assert turned.closed is None
