"""The page's map: what is drawn where, and what is offered without one."""

import base64
import struct
import zlib
from typing import Any

import pytest

from tests.scenarios.page.browser import (
    NEEDS_BROWSER,
    FakeDaemon,
    middle_of_view,
    pixel,
    show,
    sync_api,
    until,
)

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]


def packed(*values: int) -> str:
    """Cells as they are sent."""
    return base64.b64encode(zlib.compress(struct.pack(f"{len(values)}b", *values))).decode()


def test_the_map_is_drawn_where_it_is(page: Any, daemon: FakeDaemon) -> None:
    """Of 3 by 2 cells of 0.5 m from (1, 2) the upper right one is a wall, drawn up and to the right; then it goes."""
    daemon.say("odometry", x_m=9.0, y_m=9.0, heading_rad=0.0, linear_m_s=0.0, angular_rad_s=0.0)
    daemon.say("map_pose", x_m=1.0, y_m=2.0, heading_rad=-2.0, state="localized")
    grid = {"resolution_m": 0.5, "x_m": 1.0, "y_m": 2.0, "heading_rad": 0.0, "columns": 3, "rows": 2}

    whole = {"column": 0, "row": 0, "part_columns": 3, "part_rows": 2, "whole": True}
    daemon.say("map", revision=7, **grid, **whole, encoding="zlib", cells=packed(0, 0, -1, -1, 0, 100))
    middle = middle_of_view(page)
    wall, free = (
        (middle[0] + 1.25 * 90, middle[1] - 0.75 * 90),
        (middle[0] + 0.75 * 90, middle[1] - 0.75 * 90),
    )
    assert until(lambda: pixel(page, *wall) == [0x20, 0x26, 0x2D])
    assert pixel(page, *free) == [255, 255, 255]
    part = {"column": 2, "row": 1, "part_columns": 1, "part_rows": 1, "whole": False}
    daemon.say("map", revision=8, **grid, **part, encoding="zlib", cells=packed(0))
    assert until(lambda: pixel(page, *wall) == [255, 255, 255])


def test_a_part_of_a_new_map_never_goes_into_a_stored_one(page: Any, daemon: FakeDaemon) -> None:
    """A stored map of 2 by 2 cells arrives while one of 3 by 2 is begun: the new one is shown, with its wall.

    Nor does a late part change the stored map, once it is in use again.
    """
    mapping = {"name": None, "loops": 0, "path_m": 0.0, "unfinished": False, "reason": ""}
    place = {"resolution_m": 0.5, "x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0}
    stored = {**place, "columns": 2, "rows": 2, "version": 1, "parts": 1, "data": packed(100, 100, 100, 100)}
    new = {**place, "columns": 3, "rows": 2, "encoding": "zlib"}
    part = {"column": 2, "row": 1, "part_columns": 1, "part_rows": 1, "whole": False, "cells": packed(100)}
    whole = {
        "column": 0,
        "row": 0,
        "part_columns": 3,
        "part_rows": 2,
        "whole": True,
        "cells": packed(*[0] * 6),
    }
    daemon.held = {"list_maps", "get_map"}
    daemon.say("map_pose", x_m=0.0, y_m=0.0, heading_rad=2.0, state="localized")
    daemon.say("mapping", state="idle", **mapping)
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    listed = {"in_use": "flat", "maps": [{"name": "flat", "in_use": True}]}
    while daemon.waits("list_maps"):
        daemon.answer("list_maps", **listed)
    assert until(lambda: daemon.was_asked("get_map"))
    daemon.say("mapping", state="mapping", **mapping)
    daemon.say("map", revision=1, **new, **whole)
    daemon.answer("get_map", **stored)
    daemon.say("map", revision=2, **new, **part)
    x, y = middle_of_view(page)
    wall, free = (x + 1.25 * 90, y - 0.75 * 90), (x + 0.25 * 90, y - 0.75 * 90)
    assert until(lambda: pixel(page, *wall) == [0x20, 0x26, 0x2D])
    assert pixel(page, *free) == [255, 255, 255]
    daemon.say("mapping", state="idle", **mapping)
    daemon.answer("list_maps", **listed)
    assert until(lambda: daemon.waits("get_map"))
    daemon.answer("get_map", **stored)
    assert until(lambda: pixel(page, *free) == [0x20, 0x26, 0x2D])
    daemon.say("map", revision=3, **new, **{**part, "column": 0, "cells": packed(0)})
    page.wait_for_timeout(300)
    assert pixel(page, *free) == [0x20, 0x26, 0x2D]
    sync_api.expect(page.locator("#alert")).to_be_empty()


def test_without_a_map_the_page_says_what_to_do_first(page: Any, daemon: FakeDaemon) -> None:
    """No map in use: not that a click sends the robot somewhere, and nothing that needs a map; with one, both."""
    daemon.say("localization", state="unknown", map=None, fit=0.0, reason="")
    sync_api.expect(page.locator("#goal")).to_contain_text("No map is in use")
    sync_api.expect(page.locator("#map-told")).to_contain_text("Start one and drive")
    show(page, "map")
    sync_api.expect(page.locator("#map-start")).to_be_visible()
    sync_api.expect(page.locator("#map-localize")).to_be_hidden()
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    sync_api.expect(page.locator("#goal")).to_contain_text("Click in the view")
    for name in ("#map-localize", "#map-localize-turn"):
        sync_api.expect(page.locator(name)).to_be_visible()
    page.locator("#map-localize-turn").click()
    sync_api.expect(page.locator("#alert")).to_contain_text("The robot knows where it is.")
    assert ("localize", {"turn": True}) in daemon.asked
