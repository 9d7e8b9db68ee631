"""The map is the page: its panels, the sheet of a phone, its layers, and that nothing moves or covers a stop."""

import math
from collections.abc import Iterator
from typing import Any, ClassVar

import pytest

from tests.chefbotd.components.maps.page.test_map import packed
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
from tests.scenarios.page.test_agents import BUTTONS, QUESTION, WAITER
from tests.scenarios.page.test_stops import ARMED, Fingers, count

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]
DESKTOP, ENLARGED, UPRIGHT, LYING = (1366, 768), (683, 384), (360, 740), (740, 360)
"""A desktop, the same at 200 %, and a phone."""
NO_MAP = {"state": "unknown", "map": None, "fit": 0.0, "reason": ""}
IDLE = {"state": "idle", "name": None, "loops": 0, "path_m": 0.0, "unfinished": False, "reason": ""}
DOWN = {"state": "down", "device": "", "reason": "was it unplugged?", "healthy": False, "condition": "down"}
LOST = {**ARMED, "mode": "disarmed", "armed": False, "fault": "link_lost", "reason": "the link was lost"}
REFUSED = {"code": -32000, "message": "the goal lies in a zone, " * 6, "data": {"kind": "out_of_range"}}


class GuestDaemon(FakeDaemon):
    """It lets the page in as a guest."""

    RESULTS: ClassVar[dict[str, Any]] = {
        **FakeDaemon.RESULTS,
        "authenticate": {"role": "guest"},
        "describe": {
            "methods": {name: {"role": "drive", "for_guests": False} for name in FakeDaemon.METHODS[:1]},
            "topics": {"recording": {"for_guests": False}},
        },
    }


def opened(page: Any, served: str, size: tuple[int, int], kind: type[FakeDaemon] = FakeDaemon) -> FakeDaemon:
    """The page in a window of this size, before a robot that is armed and knows its map."""
    page.set_viewport_size({"width": size[0], "height": size[1]})
    daemon = kind(page)
    daemon.opened(served)
    daemon.say("safety", **ARMED)
    daemon.say("mapping", **IDLE)
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    sync_api.expect(page.locator("#mode-word")).to_have_text("Ready to drive")
    return daemon


@pytest.fixture
def phone(browser: Any) -> Iterator[Any]:
    """A tab of an upright phone with a touch screen."""
    context = browser.new_context(viewport={"width": 360, "height": 740}, has_touch=True, is_mobile=True)
    yield context.new_page()
    context.close()


PLACES = """() => Object.fromEntries([...document.querySelectorAll("button, input, select")]
  .filter((part) => part.id && part.checkVisibility({ visibilityProperty: true }))
  .map((part) => [part.id, Object.values(part.getBoundingClientRect().toJSON()).slice(0, 4).map(Math.round)]))"""


@pytest.mark.parametrize("size", [DESKTOP, UPRIGHT, LYING])
def test_nothing_moves_by_an_error_a_mode_or_a_card(page: Any, served: str, size: tuple[int, int]) -> None:
    """With the driving open and a finger at it, each button that was there is where it was, to one pixel."""
    daemon = opened(page, served, size)
    show(page, "drive")
    page.locator("#linear").hover()
    page.wait_for_timeout(400)  # until a sheet is as high as it gets
    before = page.evaluate(PLACES)
    assert {"estop", "stop", "arm", "linear", "tab-drive", "tab-workshop", "zoom-in"} <= set(before)

    def moved() -> dict[str, Any]:
        now = page.evaluate(PLACES)
        far = {name for name, place in before.items() if now.get(name) != pytest.approx(place, abs=1)}
        return {name: (before[name], now.get(name)) for name in far}

    daemon.refusal = REFUSED
    page.keyboard.press("Space")
    sync_api.expect(page.locator("#alert")).to_contain_text("The goal lies in a zone")
    page.locator("#unreached-hide").click()
    assert moved() == {}
    daemon.say("safety", **LOST)
    daemon.say("link", **DOWN)
    sync_api.expect(page.locator("#mode-word")).to_have_text("The robot may still be driving")
    assert moved() == {}
    daemon.say("agents", agents=[WAITER], buttons=BUTTONS, questions=[QUESTION])
    sync_api.expect(page.locator("#tab-programs")).to_be_visible()
    page.evaluate("""() => { const card = document.createElement("section");
      Object.assign(card, { className: "card", innerHTML: "<h2>Weather</h2><p>It rains.</p>" });
      document.getElementById("driving").before(card); }""")
    sync_api.expect(page.get_by_role("heading", name="Weather")).to_have_count(1)
    assert moved() == {}


ON_TOP = """() => ["estop", "stop", "arm"].flatMap((id) => {
  const box = document.getElementById(id).getBoundingClientRect();
  if (box.x < 0 || box.right > innerWidth || box.bottom > innerHeight) return ["out of the window"];
  const [left, right, top, bottom] = [box.left + 3, box.right - 3, box.top + 3, box.bottom - 3];
  const points = [[left, top], [right, top], [left, bottom], [right, bottom], [(left + right) / 2, (top + bottom) / 2]];
  return points.map(([x, y]) => document.elementFromPoint(x, y)?.closest("button")?.id).filter((other) => other !== id);
})"""


@pytest.mark.parametrize("size", [DESKTOP, ENLARGED, UPRIGHT, LYING])
def test_nothing_covers_a_stop(page: Any, served: str, size: tuple[int, int]) -> None:
    """A full sheet, a first visit's steps, a question and a stop that did not arrive, one over the other."""
    daemon = opened(page, served, size)
    show(page, "goals")
    if page.locator("#grip").is_visible():
        page.locator("#grip").click()
        sync_api.expect(page.locator("#dock")).to_have_attribute("data-size", "full")
    assert page.evaluate(ON_TOP) == []
    page.locator("#place").fill("table 3")
    page.locator("#place-delete").click()
    sync_api.expect(page.locator("#confirm")).to_be_visible()
    assert page.evaluate(ON_TOP) == []
    daemon.say("localization", **NO_MAP)
    daemon.say("mapping", **{**IDLE, "unfinished": True})
    sync_api.expect(page.locator("#guide")).to_be_visible()
    assert page.evaluate(ON_TOP) == []
    daemon.refusal = REFUSED
    page.keyboard.press("Escape")
    sync_api.expect(page.locator("#unreached")).to_be_visible()
    assert page.evaluate(ON_TOP) == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_the_panel_that_was_chosen_is_kept(page: Any, served: str) -> None:
    """At first it is the driving; one is open at a time; closed, the map has its room, also after a reload."""
    opened(page, served, DESKTOP)
    panels = page.locator(".panel:visible")
    sync_api.expect(panels).to_have_attribute("id", "panel-drive")
    show(page, "workshop")
    sync_api.expect(panels).to_have_count(1)
    beside = page.locator("#room").bounding_box()["width"]
    page.reload()
    sync_api.expect(panels).to_have_attribute("id", "panel-workshop")
    page.locator("#tab-workshop").click()
    sync_api.expect(panels).to_have_count(0)
    assert page.locator("#room").bounding_box()["width"] > beside + 300
    page.reload()
    sync_api.expect(page.locator("#tab-workshop")).to_be_visible()
    page.wait_for_timeout(300)
    sync_api.expect(panels).to_have_count(0)


@pytest.mark.parametrize("size", [DESKTOP, UPRIGHT])
def test_a_guest_has_programs_the_map_and_the_stops(page: Any, served: str, size: tuple[int, int]) -> None:
    """No other tab is there, and the programs are open."""
    daemon = opened(page, served, size, GuestDaemon)
    daemon.say("agents", agents=[WAITER], buttons=BUTTONS, questions=[QUESTION])
    sync_api.expect(page.get_by_role("button", name="Table 2")).to_be_visible()
    sync_api.expect(page.locator("#rail button:visible")).to_have_text(["Programs"])
    assert barriers(page) == []


def test_on_a_phone_the_map_comes_first_and_the_sheet_has_three_sizes(phone: Any, served: str) -> None:
    """By its tabs, by pressing its grip, and by keys; the map has what the sheet leaves."""
    opened(phone, served, UPRIGHT)
    dock, grip, room = phone.locator("#dock"), phone.locator("#grip"), phone.locator("#room")
    sync_api.expect(dock).to_have_attribute("data-size", "closed")
    assert room.bounding_box()["height"] > 0.6 * 740
    phone.locator("#tab-goals").tap()
    sync_api.expect(dock).to_have_attribute("data-size", "half")
    phone.wait_for_timeout(400)
    assert room.bounding_box()["height"] > 0.4 * 740
    sync_api.expect(grip).to_have_attribute("aria-label", "Make the panel larger")
    grip.press("Enter")
    sync_api.expect(dock).to_have_attribute("data-size", "full")
    phone.wait_for_timeout(400)
    assert room.bounding_box()["height"] >= 80
    grip.press("Enter")
    sync_api.expect(dock).to_have_attribute("data-size", "half")
    phone.locator("#tab-goals").tap()
    sync_api.expect(dock).to_have_attribute("data-size", "closed")


def test_the_sheet_is_dragged_and_a_stop_works_meanwhile(phone: Any, served: str) -> None:
    """Up it opens and gets full, down it closes; with a finger that drags it, another one stops at the touch."""
    daemon = opened(phone, served, UPRIGHT)
    dock, fingers = phone.locator("#dock"), Fingers(phone)
    fingers.down(1, "#grip")
    fingers.move(1, 0.0, -480.0)
    before = count(daemon, "estop")
    fingers.down(2, "#estop")
    assert until(lambda: count(daemon, "estop") == before + 1)
    fingers.up(2)
    fingers.up(1)
    sync_api.expect(dock).to_have_attribute("data-size", "full")
    phone.wait_for_timeout(400)
    fingers.down(1, "#grip")
    fingers.move(1, 0.0, 250.0)
    fingers.up(1)
    sync_api.expect(dock).to_have_attribute("data-size", "half")
    phone.wait_for_timeout(400)
    fingers.down(1, "#grip")
    fingers.move(1, 0.0, 200.0)
    fingers.up(1)
    sync_api.expect(dock).to_have_attribute("data-size", "closed")


SCAN = {"lidar": "top", "x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0, "bearing_start_rad": 0.0}
SEEN = {**SCAN, "bearing_step_rad": 0.01, "bearing_mrad": [], "range_mm": [1000] * 7}
"""Some points a metre ahead."""


def scan_is_drawn(page: Any, right: int, down: int) -> bool:
    """Whether points of the lidar are drawn so many pixels from the middle of the view, or next to that."""
    x, y = middle_of_view(page)
    around = [(x + right + i, y + down + j) for i in (-2, -1, 0, 1, 2) for j in (-4, -2, 0, 2)]
    return any(red - green > 120 for red, green, _ in (pixel(page, *point) for point in around))


def test_what_a_lidar_saw_stays_where_it_was_while_the_robot_turns(page: Any, served: str) -> None:
    """Seen at 2 s a metre ahead, and drawn there at 2.1 s, when the robot looks to the left by 90 degrees.

    What was seen between two poses is drawn from halfway between them: at 45 degrees.
    """
    page.emulate_media(color_scheme="light")
    daemon = opened(page, served, DESKTOP)

    def stand(stamp_s: float, heading_rad: float) -> None:
        place = {"x_m": 0.0, "y_m": 0.0, "heading_rad": heading_rad}
        daemon.say("map_pose", stamp_s=stamp_s, **place, state="localized", map="flat")

    stand(2.0, 0.0)
    daemon.say("scan", stamp_s=2.0, **SEEN)
    assert until(lambda: scan_is_drawn(page, 90, 0))
    stand(2.1, math.pi / 2)
    page.wait_for_timeout(300)
    assert scan_is_drawn(page, 90, 0)
    assert not scan_is_drawn(page, 0, -90)
    daemon.say("scan", stamp_s=2.05, **SEEN)
    assert until(lambda: scan_is_drawn(page, 64, -64))
    assert not scan_is_drawn(page, 0, -90)


def test_a_layer_is_switched_off_by_its_row_of_the_legend_and_stays_so(page: Any, served: str) -> None:
    """The lidar's points are drawn, not drawn, and after a reload not drawn; the legend has only what there is."""
    page.emulate_media(color_scheme="light")
    daemon = opened(page, served, DESKTOP)

    def see() -> None:
        daemon.say("map_pose", x_m=0.0, y_m=0.0, heading_rad=0.0, state="localized", map="flat")
        daemon.say("scan", **SEEN)

    def is_drawn() -> bool:
        return scan_is_drawn(page, 90, 0)

    see()
    assert until(is_drawn)
    page.locator("#layers-show").click()
    sync_api.expect(page.locator("#layer-path")).to_be_hidden()  # there is none
    switch = page.get_by_role("switch", name="lidar")
    assert switch.get_attribute("aria-checked") == "true"
    assert barriers(page) == []
    switch.press("Enter")
    assert until(lambda: not is_drawn())
    daemon.asked.clear()
    page.reload()
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    see()
    sync_api.expect(switch).to_have_attribute("aria-checked", "false")
    page.wait_for_timeout(200)
    assert not is_drawn()
    switch.press("Enter")
    assert until(is_drawn)


def test_the_whole_map_is_shown_in_what_the_panel_leaves(page: Any, served: str) -> None:
    """Of 40 by 20 cells of 0.5 m about (10, 5), all walls: 20 m fit into the room, the middle is its middle."""
    page.emulate_media(color_scheme="light")
    daemon = opened(page, served, DESKTOP)
    button = page.get_by_role("button", name="Show the whole map")
    sync_api.expect(button).to_be_hidden()
    grid = {"resolution_m": 0.5, "x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0, "columns": 40, "rows": 20}
    whole = {"column": 0, "row": 0, "part_columns": 40, "part_rows": 20, "whole": True}
    daemon.say("map", revision=1, **grid, **whole, encoding="zlib", cells=packed(*[100] * 800))
    button.click()
    room = page.locator("#room").bounding_box()
    x, y = middle_of_view(page)
    wall = [0x20, 0x26, 0x2D]
    assert until(lambda: pixel(page, x + 0.42 * room["width"], y) == wall)
    assert pixel(page, x - 0.42 * room["width"], y) == wall
    assert pixel(page, x - 0.47 * room["width"], y) != wall
    sync_api.expect(page.locator("#follow")).not_to_be_checked()
    show(page, "workshop")
    page.locator("#follow").press("Enter")  # Space is the stop
    sync_api.expect(page.locator("#follow")).to_be_checked()


@pytest.mark.parametrize("size", [DESKTOP, UPRIGHT])
def test_the_keyboard_alone_opens_every_panel(page: Any, served: str, size: tuple[int, int]) -> None:
    """Each tab takes the focus by the tabulator key in its order, and Enter opens it; the stops come last of all."""
    opened(page, served, size)
    page.locator("#view").focus()
    reached: list[str] = []
    for _ in range(100):
        page.keyboard.press("Tab")
        name = page.evaluate("document.activeElement?.id ?? ''")
        if name.startswith("tab-"):
            if page.locator(f"#{name}").get_attribute("aria-expanded") == "false":
                page.keyboard.press("Enter")
            sync_api.expect(page.locator(f"#panel-{name.removeprefix('tab-')}")).to_be_visible()
        reached.append(name)
        if name == "stop":
            break
    assert [name for name in reached if name.startswith("tab-")] == [
        "tab-drive",
        "tab-goals",
        "tab-map",
        "tab-lately",
        "tab-workshop",
    ]
    assert {"zoom-in", "follow", "layers-show", "gesture"} <= set(reached)
    assert reached[-2:] == ["estop", "stop"]
