"""The card that edits the map, in a real browser before a daemon of the tests."""

import base64
import math
import zlib
from typing import Any, ClassVar

import numpy as np
import pytest

from tests.scenarios.page.browser import (
    NEEDS_BROWSER,
    FakeDaemon,
    barriers,
    middle_of_view,
    pixel,
    show,
    sync_api,
)

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]
TURNED_DEG = 8.0
NOTHING = {"to": None, "width_m": None}
WALL = {
    **NOTHING,
    "id": "a1",
    "kind": "wall",
    "points_m": [[0.0, 0.0], [1.2, 0.0], [1.2, 1.2]],
    "width_m": 0.1,
}
ERASED = {
    **NOTHING,
    "id": "b2",
    "kind": "erase",
    "points_m": [[30, 1], [32, 1], [32, 2], [30, 2]],
    "to": "unknown",
}
CROP = {**NOTHING, "id": "c3", "kind": "crop", "points_m": [[-2, -2], [3, -2], [3, 2], [-2, 2]]}


def turned_room() -> dict[str, Any]:
    """The walls of a room of 4 by 3 m, turned by 8 degrees, in cells of 5 cm."""
    cells = np.zeros((120, 120), np.int8)
    angle = math.radians(TURNED_DEG)
    for along in np.linspace(0, 1, 2000):
        for x, y in ((4 * along, 0), (4 * along, 3), (0, 3 * along), (4, 3 * along)):
            column = (x * math.cos(angle) - y * math.sin(angle) + 1) / 0.05
            row = (x * math.sin(angle) + y * math.cos(angle) + 0.5) / 0.05
            cells[int(row), int(column)] = 100
    extent = {"resolution_m": 0.05, "columns": 120, "rows": 120, "x_m": -3.0, "y_m": -3.0, "heading_rad": 0.0}
    data = base64.b64encode(zlib.compress(cells.tobytes())).decode()
    about = {"name": "flat", "version": 1, "stamp_s": 1.0, "saved_at_s": 1.0, "encoding": "base64 zlib int8"}
    return {**about, **extent, "part": 0, "parts": 1, "edits": None, "data": data}


class DaemonWithEdits(FakeDaemon):
    """It has a map in use with one edit."""

    METHODS = (
        *FakeDaemon.METHODS, "get_map", "list_map_edits", "edit_map", "undo_map_edit", "redo_map_edit",
        "delete_map_edit", "turn_map_view", "rename_map", "copy_map",
    )  # fmt: skip
    TOPICS = (*FakeDaemon.TOPICS, "map_edits")
    RESULTS: ClassVar[dict[str, Any]] = {
        **FakeDaemon.RESULTS,
        "get_map": turned_room(),
        "list_maps": {"in_use": "flat", "maps": [{"name": "flat", "in_use": True}]},
        "list_map_edits": {
            "map": "flat", "revision": "r1", "edits": [WALL], "view_angle_rad": 0.0, "can_undo": True, "can_redo": False,
        },
    }  # fmt: skip


@pytest.fixture
def edits(page: Any, served: str) -> DaemonWithEdits:
    """The page is open on it, and the map is in use."""
    daemon = DaemonWithEdits(page)
    daemon.opened(served)
    daemon.say("localization", state="localized", map="flat", reason="", fit=0.9)
    show(page, "map")
    sync_api.expect(page.locator("#edits-told")).to_have_text("One change is drawn on the map.")
    page.wait_for_timeout(100)  # until the map is as wide as it gets
    return daemon


def test_a_part_is_erased_a_wall_is_drawn_and_both_are_taken_back(page: Any, edits: DaemonWithEdits) -> None:
    """Two clicks are a rectangle; nothing sends the robot off; each is asked for with the revision that was read."""
    x, y = middle_of_view(page)
    page.get_by_label("What is erased becomes unknown").check()
    page.get_by_role("button", name="Erase a rectangle").click()
    page.mouse.click(x - 90, y)
    page.mouse.click(x, y - 45)
    assert barriers(page) == []
    page.get_by_role("button", name="Done").click()
    erased = edits.last("edit_map")
    assert (erased["kind"], erased["to"], erased["revision"], erased["map"]) == (
        "erase",
        "unknown",
        "r1",
        "flat",
    )
    (left, bottom), (right, _), (_, top), _ = erased["points_m"]
    assert right - left == pytest.approx(2 * (top - bottom), rel=0.02)  # 90 px across, 45 px up
    page.get_by_role("button", name="Draw a wall on the map").click()
    page.mouse.click(x - 50, y)
    page.mouse.click(x + 50, y)
    thin = pixel(page, x, y - 9)
    page.get_by_role("spinbutton", name="Width").fill("0.25")  # 22 pixels
    page.wait_for_timeout(100)
    assert pixel(page, x, y - 9) != thin
    assert barriers(page) == []
    page.get_by_role("button", name="Done").click()
    wall = edits.last("edit_map")
    assert (wall["kind"], len(wall["points_m"]), "to" in wall) == ("wall", 2, False)
    assert wall["width_m"] == 0.25
    page.get_by_role("button", name="Undo", exact=True).click()
    assert edits.last("undo_map_edit") == {"map": "flat", "revision": "r1"}
    assert not edits.was_asked("navigate_to")


def test_a_map_is_straightened_and_a_click_means_the_same_place(page: Any, edits: DaemonWithEdits) -> None:
    """By its walls, within 0.1 degrees; turned by a quarter of a radian, a point above the middle is another one."""
    page.get_by_role("button", name="Straighten it").click()
    page.wait_for_timeout(300)
    assert math.degrees(edits.last("turn_map_view")["angle_rad"]) == pytest.approx(-TURNED_DEG, abs=0.1)
    turned = {**DaemonWithEdits.RESULTS["list_map_edits"], "view_angle_rad": 0.25, "revision": "r2"}
    edits.RESULTS = {**DaemonWithEdits.RESULTS, "list_map_edits": turned}  # type: ignore[misc]
    edits.say("map_edits", map="flat", revision="r2")
    sync_api.expect(page.locator("#edit-degrees")).to_have_text("14.3°")
    page.get_by_role("button", name="Draw a wall on the map").click()
    x, y = middle_of_view(page)
    page.mouse.click(x, y)
    page.mouse.click(x, y - 90)
    page.get_by_role("button", name="Done").click()
    start, end = edits.last("edit_map")["points_m"]
    assert math.atan2(end[1] - start[1], end[0] - start[0]) == pytest.approx(math.pi / 2 - 0.25, abs=0.02)


def test_a_map_is_renamed_and_kept_once_more(page: Any, edits: DaemonWithEdits) -> None:
    """The name is asked for first, and said afterwards."""
    page.get_by_role("button", name="Rename the map").click()
    sync_api.expect(page.locator("#alert")).to_have_text("Write the new name first.")
    for button, method in (("Rename the map", "rename_map"), ("Keep a copy", "copy_map")):
        page.get_by_label("New name").fill("flat in May")
        page.get_by_role("button", name=button).click()
        page.wait_for_timeout(100)
        assert edits.last(method) == {"name": "flat", "new_name": "flat in May"}
    sync_api.expect(page.locator("#edit-named")).to_have_text("The map flat is kept as flat in May, too.")


def test_each_edit_is_listed_pointed_out_and_taken_off_by_itself(page: Any, edits: DaemonWithEdits) -> None:
    """1.2 m and 1.2 m of a wall, 2 by 1 m erased, 5 by 4 m kept; the last one first. One that is far off is shown."""
    listed = {**DaemonWithEdits.RESULTS["list_map_edits"], "edits": [WALL, ERASED, CROP], "revision": "r2"}
    edits.RESULTS = {**DaemonWithEdits.RESULTS, "list_map_edits": listed}  # type: ignore[misc]
    edits.say("map_edits", map="flat", revision="r2")
    what = page.locator("#edits li > span")
    sync_api.expect(what).to_have_text(["Cropped to 20.0 m²", "Erased to unknown, 2.0 m²", "Wall, 2.4 m"])
    assert barriers(page) == []
    x, y = middle_of_view(page)
    erased = page.get_by_role("button", name="Show on the map: Erased to unknown, 2.0 m²")
    erased.click()
    sync_api.expect(erased).to_have_attribute("aria-pressed", "true")
    sync_api.expect(page.locator("#follow")).not_to_be_checked()
    scale = 90  # pixels a metre: it fits
    assert page.evaluate("() => [...document.querySelectorAll('.point-out[aria-pressed=true]')].length") == 1
    pointed = pixel(page, x - scale, y)  # its left edge
    assert pointed[2] > pointed[0] + 60  # blue
    erased.click()
    sync_api.expect(erased).to_have_attribute("aria-pressed", "false")
    page.wait_for_timeout(100)
    assert pixel(page, x - scale, y) != pointed
    page.get_by_role("button", name="Delete: Wall, 2.4 m").click()
    assert edits.last("delete_map_edit") == {"id": "a1", "map": "flat", "revision": "r2"}
