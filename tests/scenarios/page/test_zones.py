"""The card of the zones, in a real browser before a daemon of the tests."""

from typing import Any, ClassVar

import pytest

from tests.scenarios.page.browser import (
    NEEDS_BROWSER,
    FakeDaemon,
    barriers,
    middle_of_view,
    pixel,
    show,
    sync_api,
    until,
)

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]

STAIRS = {
    "id": "3f0c",
    "kind": "keep_out",
    "name": "stairs",
    "enabled": True,
    "points_m": [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]],
    "max_speed_m_s": None,
    "width_m": None,
}
WALL = {
    **STAIRS,
    "id": "77aa",
    "kind": "wall",
    "name": "rope",
    "points_m": [[-1.0, 1.0], [1.0, 1.0]],
    "width_m": 0.2,
}


class DaemonWithZones(FakeDaemon):
    """It has one zone, about the middle of the view."""

    METHODS = (*FakeDaemon.METHODS, "list_zones", "save_zone", "delete_zone", "undo_zones")
    TOPICS = (*FakeDaemon.TOPICS, "zones")
    RESULTS: ClassVar[dict[str, Any]] = {
        **FakeDaemon.RESULTS,
        "list_zones": {"map": "flat", "revision": "r1", "zones": [STAIRS], "can_undo": True},
    }


@pytest.fixture
def zones(page: Any, served: str) -> DaemonWithZones:
    """The page is open on it, and the map is in use."""
    daemon = DaemonWithZones(page)
    daemon.opened(served)
    daemon.say("localization", state="localized", map="flat", reason="", fit=0.9)
    sync_api.expect(page.locator("#zones")).to_contain_text("stairs")
    show(page, "map")
    page.wait_for_timeout(100)  # until the map is as wide as it gets
    return daemon


def test_a_zone_is_shown_switched_off_deleted_and_brought_back(page: Any, zones: DaemonWithZones) -> None:
    """It is coloured on the map; each button sends what it says, with the revision that was read."""
    x, y = middle_of_view(page)
    inside = pixel(page, x + 15, y - 15)
    outside = pixel(page, x + 150, y - 15)
    assert inside[0] > inside[1] + 10  # reddish
    assert abs(outside[0] - outside[1]) < 6
    page.get_by_label("stairs", exact=True).click()
    asked = zones.last("save_zone")
    assert (asked["id"], asked["enabled"], asked["revision"], asked["map"]) == ("3f0c", False, "r1", "flat")
    page.get_by_role("button", name="Delete stairs").click()
    assert zones.last("delete_zone") == {"id": "3f0c", "map": "flat", "revision": "r1"}
    page.get_by_role("button", name="Undo the last change").click()
    assert zones.last("undo_zones") == {"map": "flat", "revision": "r1"}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_slow_area_is_drawn_by_three_clicks(page: Any, zones: DaemonWithZones, scheme: str) -> None:
    """No click sends the robot anywhere while it is drawn; afterwards a click does again."""
    page.emulate_media(color_scheme=scheme)
    page.get_by_role("button", name="Draw a slow area").click()
    done = page.get_by_role("button", name="Done")
    x, y = middle_of_view(page)
    for dx, dy in [(-100, 0), (100, 0), (300, 10)]:
        sync_api.expect(done).to_be_disabled()
        page.mouse.click(x + dx, y + dy)
    page.get_by_role("button", name="One corner back").click()
    sync_api.expect(page.locator("#zone-told")).to_have_text(
        "Touch the corners of the slow area: 2 so far, 1 more."
    )
    page.mouse.click(x, y - 100)
    page.get_by_label("Name", exact=True).fill("rug")
    page.get_by_label("No faster than").fill("0.15")
    assert barriers(page) == []
    done.click()
    asked = zones.last("save_zone")
    assert (asked["kind"], asked["name"], asked["max_speed_m_s"], asked["enabled"]) == (
        "slow",
        "rug",
        0.15,
        True,
    )
    (left, right, top) = asked["points_m"]
    assert right[0] - left[0] == pytest.approx(2 * (top[1] - left[1]), rel=0.02)  # 200 px across, 100 px up
    assert not zones.was_asked("navigate_to")
    page.mouse.click(x + 60, y + 60)
    assert zones.was_asked("navigate_to")


def test_a_zone_says_how_large_it_is_and_is_pointed_out(page: Any, zones: DaemonWithZones) -> None:
    """1 m by 1 m; its edge is blue while its button is pressed, and what is in sight is not moved."""
    sync_api.expect(page.locator("#zones li .small")).to_have_text("not to be entered, 1.0 m²")
    x, y = middle_of_view(page)
    before = pixel(page, x + 45, y + 20)
    button = page.get_by_role("button", name="Show stairs on the map")
    button.click()
    sync_api.expect(button).to_have_attribute("aria-pressed", "true")
    page.wait_for_timeout(100)
    red, _, blue = pixel(page, x + 45, y + 20)
    assert blue > red + 60
    sync_api.expect(page.locator("#follow")).to_be_checked()
    assert barriers(page) == []
    button.click()
    page.wait_for_timeout(100)
    assert pixel(page, x + 45, y + 20) == before


def test_a_wall_is_as_wide_as_is_chosen_and_keeps_its_width(page: Any, zones: DaemonWithZones) -> None:
    """A new one by the number that is written; one that is changed has the width that it had."""
    page.get_by_role("button", name="Draw a wall").click()
    x, y = middle_of_view(page)
    page.mouse.click(x - 50, y)
    page.mouse.click(x + 50, y)
    page.get_by_role("spinbutton", name="Width").fill("0.3")
    page.get_by_role("button", name="Done").click()
    assert zones.last("save_zone")["width_m"] == 0.3
    zones.RESULTS = {**zones.RESULTS, "list_zones": {**zones.RESULTS["list_zones"], "zones": [WALL]}}  # type: ignore[misc]
    zones.say("zones", map="flat", revision="r2")
    page.get_by_role("button", name="Change rope").click()
    sync_api.expect(page.get_by_role("spinbutton", name="Width")).to_have_value("0.2")
    page.get_by_label("Name", exact=True).fill("red rope")
    page.get_by_role("button", name="Done").click()
    assert until(lambda: zones.last("save_zone")["name"] == "red rope")
    assert zones.last("save_zone")["width_m"] == 0.2


ROOM = """() => Object.fromEntries(["main", "#room", "#zone-drawing"].map((part) => {
  const { x, y, width, height } = document.querySelector(part).getBoundingClientRect();
  return [part, [x, y, width, height].map(Math.round)]; }))"""


SIZES = [
    (1280, 800, 0.6),
    (1200, 800, 0.6),
    (1030, 700, 0.5),
    (390, 844, 0.85),
    (844, 390, 0.7),
    (683, 384, 0.65),
]


@pytest.mark.parametrize(("width", "height", "share"), SIZES)
@pytest.mark.parametrize("kind", ["Draw a slow area", "Draw a wall"])
def test_while_a_zone_is_drawn_the_map_has_its_room(
    page: Any, served: str, kind: str, width: int, height: int, share: float
) -> None:
    """At least this share of what is between header and stops; the bar covers nothing of it, and moves nothing."""
    page.set_viewport_size({"width": width, "height": height})
    daemon = DaemonWithZones(page)
    daemon.opened(served)
    daemon.say("localization", state="localized", map="flat", reason="", fit=0.9)
    show(page, "map")
    button = page.get_by_role("button", name=kind)
    button.click()
    page.wait_for_timeout(400)  # until a sheet is gone
    before = page.evaluate(ROOM)
    (_, _, whole_width, whole_height), (_, room_y, room_width, room_height) = before["main"], before["#room"]
    assert room_width * room_height >= share * whole_width * whole_height
    bar_x, bar_y, bar_width, bar_height = before["#zone-drawing"]
    assert bar_y >= room_y + room_height
    assert bar_x >= 0
    assert bar_x + bar_width <= width
    assert bar_height <= 104
    assert page.evaluate("() => document.querySelector('#bars').scrollWidth <= innerWidth")
    x, y = middle_of_view(page)
    for dx, dy in [(-60, 0), (60, 0), (0, -60), (0, -60)]:  # the last one picks a corner up
        page.mouse.click(x + dx, y + dy)
        assert page.evaluate(ROOM) == before
    sync_api.expect(page.locator("#zone-told")).to_have_text("Touch where this corner goes.")
    assert barriers(page) == []
    page.get_by_role("button", name="Draw nothing").click()
    sync_api.expect(page.locator("#zone-drawing")).to_be_hidden()
    sync_api.expect(button).to_be_focused()


def test_a_corner_is_moved_by_two_clicks(page: Any, zones: DaemonWithZones) -> None:
    """One on the corner, one where it goes: the same zone with its other corners, and one more by a third click."""
    page.get_by_role("button", name="Change stairs").click()
    sync_api.expect(page.get_by_label("Name", exact=True)).to_have_value("stairs")
    x, y = middle_of_view(page)
    metre = 90  # pixels, at first
    page.mouse.click(x + metre / 2, y - metre / 2)
    sync_api.expect(page.locator("#zone-told")).to_have_text("Touch where this corner goes.")
    page.mouse.click(x + metre, y - metre)
    page.mouse.click(x - metre, y - metre / 2)
    page.get_by_role("button", name="Done").click()
    asked = zones.last("save_zone")
    assert (asked["id"], asked["name"], asked["kind"]) == ("3f0c", "stairs", "keep_out")
    moved = [[-0.5, -0.5], [0.5, -0.5], [1.0, 1.0], [-0.5, 0.5], [-1.0, 0.5]]
    for point, expected in zip(asked["points_m"], moved, strict=True):
        assert point == pytest.approx(expected, abs=0.03)


def test_what_the_daemon_asks_about_is_asked_on_the_page(page: Any, zones: DaemonWithZones) -> None:
    """With its words; "No" draws nothing, "Use it" confirms."""
    sentence = "there would be no way to sofa"
    zones.refusal = {"code": -32049, "message": sentence, "data": {"kind": "needs_confirmation"}}
    for answer in ("No", "Use it"):
        page.get_by_role("button", name="Draw a wall").click()
        x, y = middle_of_view(page)
        page.mouse.click(x - 50, y)
        page.mouse.click(x + 50, y)
        page.get_by_role("button", name="Done").click()
        question = page.locator("#confirm-question")
        sync_api.expect(question).to_have_text("There would be no way to sofa. Use the zone all the same?")
        assert "confirmed" not in zones.last("save_zone")
        page.locator("#confirm").get_by_role("button", name=answer, exact=True).click()
    page.wait_for_timeout(100)
    assert zones.last("save_zone")["confirmed"] is True


def test_on_a_phone_a_finger_draws_and_nothing_sticks_out(browser: Any, served: str) -> None:
    """Taps are corners at once, without a second touch, and no goal is proposed."""
    context = browser.new_context(viewport={"width": 360, "height": 740}, has_touch=True, is_mobile=True)
    page = context.new_page()
    daemon = DaemonWithZones(page)
    daemon.opened(served)
    daemon.say("localization", state="localized", map="flat", reason="", fit=0.9)
    show(page, "map")
    page.get_by_role("button", name="Draw a no-go area").tap()
    page.wait_for_timeout(300)  # until the sheet has left the map its room
    x, y = middle_of_view(page)
    for dx, dy in [(-60, 0), (60, 0), (0, -60)]:
        page.touchscreen.tap(x + dx, y + dy)
    sync_api.expect(page.locator("#proposal")).to_be_hidden()
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.get_by_role("button", name="Done").tap()
    assert len(daemon.last("save_zone")["points_m"]) == 3
    context.close()


@pytest.mark.parametrize(("width", "height"), [(1200, 800), (640, 400), (390, 844)])
def test_a_zone_is_drawn_by_the_keyboard_alone(page: Any, served: str, width: int, height: int) -> None:
    """Also at 200 %: Enter marks a corner under the cross, Shift and arrows move the map by 20 pixels."""
    page.set_viewport_size({"width": width, "height": height})
    daemon = DaemonWithZones(page)
    daemon.opened(served)
    daemon.say("localization", state="localized", map="flat", reason="", fit=0.9)
    show(page, "map")
    page.get_by_role("button", name="Draw a no-go area").focus()
    page.keyboard.press("Enter")
    sync_api.expect(page.locator("#view")).to_be_focused()
    sync_api.expect(page.locator("#view-keys")).to_be_visible()
    assert barriers(page) == []
    for key, times in (("ArrowRight", 0), ("ArrowRight", 9), ("ArrowUp", 9)):
        for _ in range(times):
            page.keyboard.press(f"Shift+{key}")
        page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    page.keyboard.type("rug")
    page.keyboard.press("Tab")
    sync_api.expect(page.get_by_role("button", name="Done")).to_be_focused()
    page.keyboard.press("Enter")
    asked = daemon.last("save_zone")
    (left, right, top) = asked["points_m"]
    assert asked["name"] == "rug"
    assert right == pytest.approx(
        [left[0] + 2.0, left[1]], abs=0.01
    )  # 9 times 20 pixels, at 90 pixels a metre
    assert top == pytest.approx([right[0], right[1] + 2.0], abs=0.01)
    assert not daemon.was_asked("drive")
    page.locator("#view").focus()
    page.keyboard.press("Enter")
    sync_api.expect(page.locator("#proposal")).to_be_visible()  # sends nothing off by itself
    assert not daemon.was_asked("navigate_to")
