"""What the page offers where there is no map yet, or one that was never finished."""

from typing import Any

import pytest

from tests.scenarios.page.browser import NEEDS_BROWSER, FakeDaemon, barriers, sync_api, until

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]

IDLE = {"state": "idle", "name": None, "loops": 0, "path_m": 0.0, "unfinished": False, "reason": ""}
NO_MAP = {"state": "unknown", "map": None, "fit": 0.0, "reason": ""}


def test_a_first_visit_begins_with_a_map(page: Any, daemon: FakeDaemon) -> None:
    """The steps and the button that takes the first one; with a map being made, or one in use, they are gone."""
    page.locator("#tab-drive").click()  # closed
    guide = page.get_by_role("region", name="First, make a map")
    daemon.say("mapping", **IDLE)
    daemon.say("localization", **NO_MAP)
    sync_api.expect(guide.get_by_role("listitem")).to_have_count(3)
    assert barriers(page) == []
    guide.get_by_role("button", name="Start a map").click()
    assert until(lambda: daemon.was_asked("start_mapping"))
    assert daemon.last("start_mapping") == {}
    sync_api.expect(page.locator("#joystick")).to_be_visible()  # the next step
    daemon.say("mapping", **{**IDLE, "state": "mapping", "path_m": 3.2, "loops": 1})
    sync_api.expect(guide).to_be_hidden()
    told = page.locator("#map-told")
    sync_api.expect(told).to_contain_text("Making a map: 3.2 m driven, 1 place recognized. Drive slowly")
    assert barriers(page) == []
    page.get_by_role("button", name="Name it and save it").click()  # the last step, wherever the reader is
    sync_api.expect(page.locator("#map-name")).to_be_focused()
    daemon.say("mapping", **IDLE)
    sync_api.expect(page.locator("#making")).to_be_hidden()
    sync_api.expect(guide).to_be_visible()
    daemon.say("localization", **{**NO_MAP, "state": "localized", "map": "flat"})
    sync_api.expect(guide).to_be_hidden()


def test_an_unfinished_map_is_gone_on_with_or_discarded(page: Any, daemon: FakeDaemon) -> None:
    """A button for either; nothing is discarded without a yes; and no button begins what would be refused."""
    daemon.say("localization", **NO_MAP)
    daemon.say("mapping", **{**IDLE, "unfinished": True})
    guide = page.get_by_role("region", name="There is an unfinished map")
    sync_api.expect(guide).to_be_visible()
    sync_api.expect(page.get_by_role("button", name="Start a map")).to_have_count(0)
    guide.get_by_role("button", name="Go on with it").click()
    assert until(lambda: daemon.was_asked("start_mapping"))
    assert daemon.last("start_mapping") == {"unfinished": True}
    discard = guide.get_by_role("button", name="Discard it")
    discard.click()
    question = page.get_by_role("alertdialog", name="Discard the map that is not saved?")
    sync_api.expect(question).to_be_visible()
    assert barriers(page) == []
    page.keyboard.press("Escape")  # is the emergency stop, here too
    assert until(lambda: daemon.was_asked("estop"))
    question.get_by_role("button", name="Keep it").click()
    sync_api.expect(question).to_be_hidden()
    assert not daemon.was_asked("discard_mapping")
    discard.click()
    question.get_by_role("button", name="Discard it").click()
    assert until(lambda: daemon.was_asked("discard_mapping"))
    daemon.say("mapping", **IDLE)
    sync_api.expect(page.locator("#guide-start")).to_be_visible()
