"""Agents on the page: what they say, their questions and their buttons, for everybody."""

from typing import Any

import pytest

from tests.scenarios.page.browser import (
    NEEDS_BROWSER,
    FakeDaemon,
    RunningRobot,
    barriers,
    show,
    sync_api,
)

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]
WAITER = {"name": "waiter", "version": "1.0", "methods": [], "text": "I am at table 1 <b>now</b>"}
BUTTONS = [{"button_id": number, "agent": "waiter", "label": f"Table {number}"} for number in (1, 2)]
QUESTION = {"question_id": 7, "agent": "waiter", "question": "Taken?", "choices": ["yes", "not yet"]}


def test_a_button_and_an_answer_are_sent_as_they_are_shown(page: Any, daemon: FakeDaemon) -> None:
    """Nothing is shown without an agent; its words are text, not markup; when it leaves, all of it is gone."""
    sync_api.expect(page.locator("#agents-part")).to_be_hidden()
    daemon.say("agents", agents=[WAITER], buttons=BUTTONS, questions=[QUESTION])
    sync_api.expect(page.locator("#agents p").first).to_have_text("I am at table 1 <b>now</b>")
    show(page, "programs")
    page.get_by_role("button", name="Table 2").click()
    assert daemon.last("press_button") == {"button_id": 2}
    page.get_by_role("group", name="Taken?").get_by_role("button", name="not yet").click()
    assert daemon.last("answer_agent") == {"question_id": 7, "choice": "not yet"}
    page.get_by_role("button", name="Table 1").focus()
    daemon.say("agents", agents=[WAITER], buttons=BUTTONS, questions=[])
    sync_api.expect(page.locator(".question")).to_have_count(0)
    sync_api.expect(page.get_by_role("button", name="Table 1")).to_be_focused()
    daemon.say("agents", agents=[], buttons=[], questions=[])
    sync_api.expect(page.locator("#agents-part")).to_be_hidden()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [360, 1200])
def test_agents_can_be_read_and_used_by_everybody(
    page: Any, daemon: FakeDaemon, scheme: str, width: int
) -> None:
    """Nothing that axe finds, and nothing beyond the edge, with the longest words, in both schemes, on a phone."""
    page.set_viewport_size({"width": width, "height": 800})
    page.emulate_media(color_scheme=scheme)
    long = {**QUESTION, "question": "W" * 200, "choices": ["c" * 40, "d" * 40]}
    daemon.say("agents", agents=[WAITER, {**WAITER, "name": "n" * 64}], buttons=BUTTONS, questions=[long])
    show(page, "programs")
    sync_api.expect(page.locator(".question")).to_have_count(1)
    assert barriers(page) == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.parametrize("robot", [{"token": "g" * 32, "role": "guest"}], indirect=True)
def test_a_guest_orders_and_cannot_drive(page: Any, robot: RunningRobot) -> None:
    """With a guest's token the page has no joystick, and a stop."""
    page.goto(robot.url)
    page.locator("#token").fill("g" * 32)
    page.get_by_role("button", name="Log in").click()
    sync_api.expect(page.locator("#role")).to_have_text("order and stop")
    sync_api.expect(page.locator("#driving")).to_be_hidden()
    sync_api.expect(page.locator("#stop")).to_be_enabled()
