"""Goals, poses and places that are given on the page, and what it costs to drive where."""

import base64
import struct
import zlib
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


def test_a_click_sends_the_robot_there_and_a_drag_gives_the_heading(page: Any, daemon: FakeDaemon) -> None:
    """At 90 pixels a metre around the robot at (2, -1): 45 right and 90 down are (2.5, -2); a drag up is 90 degrees."""
    sync_api.expect(page.locator("#goal")).to_have_text("No goal. Click in the view to send the robot there.")
    daemon.say("map_pose", x_m=2.0, y_m=-1.0, heading_rad=0.3, state="localized")
    daemon.say("navigation", state="driving", goal=1, reason="", distance_m=3.21, time_s=9.0)
    sync_api.expect(page.locator("#goal")).to_have_text("Driving, 3.2 m left")
    show(page, "goals")
    page.wait_for_timeout(100)  # until the map is as wide as it gets
    middle = middle_of_view(page)
    assert until(lambda: pixel(page, *middle) == [0x0B, 0x57, 0xD0])  # the robot is drawn
    x, y = middle[0] + 45, middle[1] + 90
    page.mouse.click(x, y)
    assert until(lambda: daemon.was_asked("navigate_to"))
    assert daemon.last("navigate_to") == {
        "x_m": pytest.approx(2.5, abs=0.02),
        "y_m": pytest.approx(-2.0, abs=0.02),
    }
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 60)
    page.mouse.up()
    assert until(lambda: "heading_rad" in daemon.last("navigate_to"))
    assert daemon.last("navigate_to")["heading_rad"] == pytest.approx(1.5708, abs=0.02)
    page.locator("#gesture").select_option("set_pose")
    page.mouse.click(x, y)
    assert until(lambda: daemon.was_asked("set_pose"))
    page.locator("#goal-cancel").click()
    assert until(lambda: daemon.was_asked("cancel_navigation"))


def test_costs_are_asked_for_while_they_are_shown(page: Any, daemon: FakeDaemon) -> None:
    """One cell of 1 m that is blocked, under the robot at its middle, is tinted until the layer is switched off."""
    daemon.say("map_pose", x_m=0.25, y_m=0.75, heading_rad=0.0, state="localized")
    costs = page.get_by_role("switch", name="costs of driving")
    page.get_by_role("button", name="What the map shows").click()
    costs.press("Enter")
    asked = {"topics": ["costmap"], "policy": "ordered"}
    assert until(lambda: daemon.was_asked("subscribe") and daemon.last("subscribe") == asked)
    cell = base64.b64encode(zlib.compress(struct.pack("b", 100))).decode()
    size = {"columns": 1, "rows": 1, "part_columns": 1, "part_rows": 1, "column": 0, "row": 0}
    place = {"resolution_m": 1.0, "x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0, "revision": 1, "map": "flat"}
    daemon.say("costmap", **place, **size, encoding="zlib", cells=cell)
    middle = middle_of_view(page)
    beside = (middle[0] + 45, middle[1] + 45)  # (0.75, 0.25)
    plain = [0xEE, 0xF1, 0xF4]
    assert until(lambda: pixel(page, *beside) != plain)
    costs.press("Enter")
    assert until(lambda: pixel(page, *beside) == plain)
    assert daemon.last("unsubscribe") == {"topics": ["costmap"]}


def test_a_place_is_gone_to_saved_and_deleted_by_its_name(page: Any, daemon: FakeDaemon) -> None:
    """The list offers the places of the map in use; nothing is asked without a name, or deleted without a yes."""
    sync_api.expect(page.locator("#place-form")).to_be_hidden()  # no map is in use
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    sync_api.expect(page.locator("#places option")).to_have_count(2)
    show(page, "goals")
    page.get_by_role("button", name="Go there").click()
    page.locator("#place").fill("table 3")
    page.get_by_role("button", name="Go there").click()
    assert until(lambda: daemon.was_asked("navigate_to"))
    assert daemon.last("navigate_to") == {"place": "table 3"}
    page.get_by_role("button", name="Save its position").click()
    assert until(lambda: daemon.was_asked("save_place"))
    assert daemon.last("save_place") == {"name": "table 3"}
    delete = page.get_by_role("button", name="Delete", exact=True)
    delete.click()
    question = page.get_by_role("alertdialog", name="Delete the place table 3 from the map flat?")
    sync_api.expect(question).to_be_visible()
    sync_api.expect(page.get_by_role("button", name="Keep it")).to_be_focused()
    assert barriers(page) == []
    page.keyboard.press("Escape")  # is the emergency stop, here too
    assert until(lambda: daemon.was_asked("estop"))
    page.keyboard.press("Enter")
    sync_api.expect(question).to_be_hidden()
    sync_api.expect(delete).to_be_focused()
    assert not daemon.was_asked("delete_place")
    delete.click()
    page.locator("#place").fill("kitchen")  # the question was about another one
    page.get_by_role("button", name="Delete it").click()
    assert until(lambda: daemon.was_asked("delete_place"))
    assert daemon.last("delete_place") == {"name": "table 3"}
    sync_api.expect(question).to_be_hidden()


def test_poses_are_typed_where_nobody_can_click(page: Any, daemon: FakeDaemon) -> None:
    """By the keyboard alone: to x, y and a heading in degrees; and the robot stands at a place, or at coordinates."""
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    sync_api.expect(page.locator("#places option")).to_have_count(2)
    show(page, "goals")
    page.locator("#place").fill("1.25 -3 -90")
    page.keyboard.press("Enter")
    assert until(lambda: daemon.was_asked("navigate_to"))
    assert daemon.last("navigate_to") == {"x_m": 1.25, "y_m": -3, "heading_rad": pytest.approx(-1.570796)}
    is_here = page.get_by_role("button", name="The robot is here")
    page.locator("#place").fill("kitchen")
    is_here.press("Enter")
    assert until(lambda: daemon.was_asked("set_pose"))
    assert daemon.last("set_pose") == {"x_m": 1.5, "y_m": -0.25, "heading_rad": 2.0}
    page.locator("#place").fill("0.5, 2")
    is_here.press("Enter")
    assert until(lambda: daemon.last("set_pose") == {"x_m": 0.5, "y_m": 2})
    page.locator("#place").fill("cellar")
    is_here.press("Enter")
    sync_api.expect(page.locator("#alert")).to_have_text("There is no place cellar on this map.")
