"""Places by their names: on the map, as buttons, and in what the page says of a goal."""

from typing import Any

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
SIZES = [(1280, 800), (360, 740)]
LIST = {"goals": [{"goal": 7, "x_m": 3.0, "y_m": 4.0, "heading_rad": 0.5, "goal_id": None}]}


@pytest.fixture
def daemon(page: Any, served: str, monkeypatch: pytest.MonkeyPatch) -> FakeDaemon:
    """A robot that knows its map and lists its goals; the page is open on it."""
    monkeypatch.setattr(FakeDaemon, "RESULTS", {**FakeDaemon.RESULTS, "list_goals": LIST})
    daemon = FakeDaemon(page)
    daemon.capable_of("list_goals")
    daemon.opened(served)
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    show(page, "goals")
    sync_api.expect(page.get_by_role("button", name="Go to table 3")).to_be_visible()
    return daemon


@pytest.mark.parametrize(("width", "height", "scheme"), [(1280, 800, "light"), (360, 740, "dark")])
def test_a_touch_on_a_place_sends_the_robot_and_the_page_says_where_it_goes(
    page: Any, daemon: FakeDaemon, width: int, height: int, scheme: str
) -> None:
    """The goal at (3, 4) is table 3: "Going to table 3, 1.5 m left", then "Arrived at table 3"; nothing is cut off."""
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": height})
    page.get_by_role("button", name="Go to table 3").click()
    assert until(lambda: daemon.was_asked("navigate_to"))
    assert daemon.last("navigate_to") == {"place": "table 3"}
    why = "drives to (3.00, 4.00)"  # as the daemon says it: the place has a name
    said = {"reason": {"id": "navigation.drives_to", "arguments": {"x_m": 3.0, "y_m": 4.0}}}
    daemon.say("navigation", state="driving", goal=7, reason=why, said=said, distance_m=1.52, time_s=4.0)
    sync_api.expect(page.locator("#goal")).to_have_text("Going to table 3, 1.5 m left")
    sync_api.expect(page.locator("#goal-told")).to_have_text("Going to table 3")
    assert barriers(page) == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    daemon.say("navigation", state="reached", goal=7, reason="", distance_m=0.0)
    sync_api.expect(page.locator("#goal")).to_have_text("Arrived at table 3")


def test_the_goal_is_marked_with_the_heading_in_which_the_robot_will_stand(
    page: Any, daemon: FakeDaemon
) -> None:
    """At 90 pixels a metre around (3, 4.5) the goal (3, 4, 0) is 45 pixels down: its arrow is 22 to the right."""
    goal = {"goal": 7, "x_m": 3.0, "y_m": 4.0, "heading_rad": 0.0, "goal_id": None}
    FakeDaemon.RESULTS["list_goals"] = {"goals": [goal]}
    daemon.say("map_pose", x_m=3.0, y_m=4.5, heading_rad=0.0, state="localized")
    daemon.say("navigation", state="driving", goal=7, reason="", distance_m=0.5, time_s=4.0)
    x, y = middle_of_view(page)
    assert until(lambda: pixel(page, x + 20, y + 45) == [0x0B, 0x57, 0xD0])
    assert pixel(page, x - 20, y + 45) != [0x0B, 0x57, 0xD0]
    daemon.say("navigation", state="cancelled", goal=7, reason="", distance_m=0.0)
    assert until(lambda: pixel(page, x + 20, y + 45) != [0x0B, 0x57, 0xD0])


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_a_touched_point_is_saved_as_a_place(page: Any, daemon: FakeDaemon, width: int, height: int) -> None:
    """With the mouse: choose it, click, give a name. A name that is there already is asked about first."""
    page.set_viewport_size({"width": width, "height": height})
    daemon.say("map_pose", x_m=2.0, y_m=-1.0, heading_rad=0.0, state="localized")
    page.locator("#gesture").select_option("save_place")
    page.wait_for_timeout(300)  # until a sheet is as high as it gets
    x, y = middle_of_view(page)
    page.mouse.click(x + 45, y)  # (2.5, -1)
    name = page.get_by_label("Name of the place")
    sync_api.expect(name).to_be_focused()
    assert barriers(page) == []
    name.fill("table 9")
    page.keyboard.press("Enter")
    assert until(lambda: daemon.was_asked("save_place"))
    saved = {"name": "table 9", "x_m": pytest.approx(2.5, abs=0.03), "y_m": pytest.approx(-1.0, abs=0.03)}
    assert daemon.last("save_place") == saved
    sync_api.expect(page.locator("#proposal")).to_be_hidden()
    page.mouse.click(x + 45, y)
    name.fill("kitchen")
    page.keyboard.press("Enter")
    sync_api.expect(
        page.get_by_role("alertdialog", name="Move the place kitchen of the map flat there?")
    ).to_be_visible()
    assert daemon.last("save_place") == saved
    page.get_by_role("button", name="Move it").click()
    assert until(lambda: daemon.last("save_place")["name"] == "kitchen")
