"""The list of goals: what is asked of the daemon for it, and that nothing drives it but who asked for it."""

from typing import Any

import pytest

from tests.scenarios.page.browser import (
    NEEDS_BROWSER,
    FakeDaemon,
    barriers,
    middle_of_view,
    show,
    sync_api,
    until,
)

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]

KITCHEN, TABLE, POSE = {"place": "kitchen"}, {"place": "table 3"}, {"x_m": 2, "y_m": -1}


def listed(page: Any, daemon: FakeDaemon) -> Any:
    """A list of three goals that nobody drives yet; its items."""
    daemon.held = {"follow_waypoints", "navigate_to"}
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    sync_api.expect(page.locator("#places option")).to_have_count(2)
    show(page, "goals")
    for name in ("kitchen", "table 3", "2 -1"):
        page.locator("#place").fill(name)
        page.get_by_role("button", name="Add to the list").click()
    items = page.locator("#route li > span")
    sync_api.expect(items).to_have_text(["kitchen", "table 3", "2 -1"])
    assert not daemon.was_asked("follow_waypoints")
    return items


def requests(daemon: FakeDaemon, method: str) -> int:
    """How many requests of a method have come."""
    daemon.was_asked(method)
    return sum(name == method for name, _ in daemon.asked)


def driving(daemon: FakeDaemon, goal: int) -> None:
    """The daemon is on the way to a goal."""
    daemon.say("navigation", state="driving", goal=goal, reason="", distance_m=1.0, time_s=5.0)


def test_a_list_is_driven_by_one_request_that_waits(page: Any, daemon: FakeDaemon) -> None:
    """``wait``: so the daemon itself ends all of it with the page. Goals that are reached leave the list."""
    daemon.say("navigation", state="reached", goal=6, reason="", distance_m=None, time_s=None)
    items = listed(page, daemon)
    assert barriers(page) == []
    page.get_by_role("button", name="Drive to all").click()
    assert until(lambda: daemon.was_asked("follow_waypoints"))
    assert daemon.last("follow_waypoints") == {"waypoints": [KITCHEN, TABLE, POSE], "wait": True}
    sync_api.expect(items.first).to_have_text("kitchen (on the way)")
    driving(daemon, 7)
    driving(daemon, 8)
    sync_api.expect(items).to_have_text(["table 3 (on the way)", "2 -1"])
    daemon.answer("follow_waypoints", goal=9, end="reached", reason="")
    sync_api.expect(page.locator("#route-part")).to_be_hidden()


def test_a_list_that_ended_otherwise_is_kept_and_not_driven(page: Any, daemon: FakeDaemon) -> None:
    """After a stop what is left stands there, until somebody presses the button again; so it is without a connection."""
    items = listed(page, daemon)
    go = page.get_by_role("button", name="Drive to all")
    go.click()
    driving(daemon, 1)
    driving(daemon, 2)
    sync_api.expect(items).to_have_text(["table 3 (on the way)", "2 -1"])
    daemon.answer("follow_waypoints", goal=2, end="cancelled", reason="cancelled: by Ann")
    sync_api.expect(items).to_have_text(["table 3", "2 -1"])
    driving(daemon, 3)  # of another client
    driving(daemon, 4)
    sync_api.expect(items).to_have_text(["table 3", "2 -1"])
    go.click()
    assert until(lambda: requests(daemon, "follow_waypoints") == 2)
    assert daemon.last("follow_waypoints")["waypoints"] == [TABLE, POSE]
    daemon.disconnect()
    sync_api.expect(go).to_be_visible()
    assert until(lambda: requests(daemon, "authenticate") == 2)
    sync_api.expect(items).to_have_text(["table 3", "2 -1"])
    assert requests(daemon, "follow_waypoints") == 2


def test_a_list_is_changed_on_the_way(page: Any, daemon: FakeDaemon) -> None:
    """One more is queued behind the others; without one the rest is sent anew; without any, all are cancelled."""
    items = listed(page, daemon)
    page.get_by_role("button", name="Drive to all").click()
    driving(daemon, 1)
    page.locator("#place").fill("kitchen")
    page.get_by_role("button", name="Add to the list").click()
    assert until(lambda: daemon.was_asked("navigate_to"))
    assert daemon.last("navigate_to") == {**KITCHEN, "queue": True, "wait": True}
    page.get_by_role("button", name="Remove table 3 from the list").click()
    assert until(lambda: requests(daemon, "follow_waypoints") == 2)
    assert daemon.last("follow_waypoints")["waypoints"] == [KITCHEN, POSE, KITCHEN]
    daemon.answer("follow_waypoints", goal=3, end="cancelled", reason="cancelled: a new goal replaced it")
    driving(daemon, 5)
    sync_api.expect(items).to_have_text(["kitchen (on the way)", "2 -1", "kitchen"])
    assert not daemon.was_asked("cancel_navigation")
    page.get_by_role("button", name="Clear the list").click()
    assert until(lambda: daemon.was_asked("cancel_navigation"))
    sync_api.expect(page.locator("#route-part")).to_be_hidden()


def test_a_click_adds_a_goal_to_the_list(page: Any, daemon: FakeDaemon) -> None:
    """If that is what a click means; nothing drives."""
    daemon.say("map_pose", x_m=2.0, y_m=-1.0, heading_rad=0.3, state="localized")
    page.locator("#gesture").select_option("follow_waypoints")
    page.mouse.click(*middle_of_view(page))
    sync_api.expect(page.locator("#route li")).to_have_count(1)
    assert not daemon.was_asked("follow_waypoints")
