"""What the page shows of a robot, how much it loads, and whether everybody can read and use it."""

import re
from typing import Any

import pytest

from tests.scenarios.page.browser import (
    NEEDS_BROWSER,
    FakeDaemon,
    RunningRobot,
    barriers,
    open_page,
    sync_api,
    until,
)

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]
MOST_BYTES = 300_000


def test_it_loads_light_and_only_from_the_robot(page: Any, robot: RunningRobot) -> None:
    """Less than 300 kB, nothing from elsewhere; what the robot has not is not shown, and every control has a name."""
    answers: list[Any] = []
    page.on("response", lambda answer: answers.append(answer))
    open_page(page, robot)
    assert {answer.url.startswith(robot.url) for answer in answers} == {True}
    assert 5_000 < sum(len(answer.body()) for answer in answers) < MOST_BYTES
    assert page.locator("#robot").inner_text() == "chefbot"
    assert page.locator("#wheels-part").is_visible()
    assert not page.locator("#map-part").is_visible()
    assert not page.locator("#gesture-label").is_visible()
    sync_api.expect(page.locator("#wheels tr")).to_have_count(2)
    sync_api.expect(page.locator("#wheels tr").first.locator("td").nth(3)).to_have_text("200")  # kp
    tree = page.locator("body").aria_snapshot()
    assert not re.search(r"^\s*- (button|slider|combobox|checkbox|textbox)\s*(:|\[|$)", tree, re.MULTILINE), (
        tree
    )


@pytest.mark.parametrize("robot", [{"name": "khan"}], indirect=True)
def test_a_robot_with_four_wheels_and_no_lidar_shows_what_it_has(page: Any, robot: RunningRobot) -> None:
    """KHAN: a row for each wheel, its one range finder, no lidar, map, goal or place; and it drives."""
    open_page(page, robot)
    assert page.locator("#robot").inner_text() == "khan"
    sync_api.expect(page.locator("#wheels th")).to_have_text(
        ["front left", "front right", "rear left", "rear right"]
    )
    sync_api.expect(page.locator("#sensors li")).to_have_count(1)
    sync_api.expect(page.locator("#sensors li")).to_contain_text("front")
    for part in ("#map-part", "#goal-part", "#gesture-label", "#costs-label", "#legend-scan", "#legend-map"):
        sync_api.expect(page.locator(part)).to_be_hidden()
    with robot.client() as client:
        page.keyboard.down("KeyD")
        assert until(lambda: client.get_state().odometry.angular_rad_s < -0.2)
        page.keyboard.up("KeyD")
        assert until(lambda: abs(client.get_state().odometry.angular_rad_s) < 0.02)


def test_a_gain_is_set_for_a_wheel_and_taken_back(page: Any, robot: RunningRobot) -> None:
    """The daemon has the new gain, the table shows it, and undo brings the packaged 200 back."""
    open_page(page, robot)
    shown = page.locator("tr[data-wheel=left_wheel] td").nth(3)
    sync_api.expect(shown).to_have_text("200")
    page.locator("#gain-wheel").select_option("left_wheel")
    page.locator("#gain-value").fill("170.5")
    page.get_by_role("button", name="Set").click()
    sync_api.expect(shown).to_have_text("170.5")
    with robot.client() as client:
        gains = client.get_pid()
    assert (gains["left_wheel"].kp, gains["right_wheel"].kp) == (170.5, 200.0)
    page.get_by_role("button", name="Undo").click()
    sync_api.expect(shown).to_have_text("200")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1200, 390])
def test_it_has_no_barrier_that_axe_can_find(page: Any, daemon: FakeDaemon, scheme: str, width: int) -> None:
    """Names, roles, contrast and order, with every part shown, on a screen and on a phone, by day and by night."""
    page.set_viewport_size({"width": width, "height": 800})
    page.emulate_media(color_scheme=scheme)
    daemon.say("navigation", state="driving", goal=1, reason="", distance_m=3.21, time_s=9.0)
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    daemon.say("safety", mode="estopped", reason="by Ann", armed=False, source=None, control={})
    sync_api.expect(page.locator("#place-form")).to_be_visible()
    assert barriers(page) == []


def test_a_screen_reader_is_told_faults_at_once_and_goals_without_the_metres(
    page: Any, daemon: FakeDaemon
) -> None:
    """A fault interrupts; what is left to drive changes all the time and is not read out, how the goal ends is."""
    ready = {"mode": "armed", "reason": "armed", "armed": True, "source": None, "control": {}}
    daemon.say("safety", **ready)
    told = page.locator("#mode-told")
    sync_api.expect(told).to_have_text("Ready to drive")
    assert told.get_attribute("aria-live") == "polite"
    sync_api.expect(page.locator("#arm")).to_be_disabled()
    stalled = {"mode": "disarmed", "reason": "left_wheel does not turn: check its plug", "armed": False}
    daemon.say("safety", **{**ready, **stalled})
    sync_api.expect(told).to_contain_text("check its plug. When it is safe, press Arm.")
    assert told.get_attribute("aria-live") == "assertive"
    daemon.say("navigation", state="driving", goal=1, reason="", distance_m=3.21, time_s=9.0)
    sync_api.expect(page.locator("#goal-told")).to_have_text("driving")
    daemon.say("navigation", state="blocked", goal=1, reason="a chair", distance_m=1.0, time_s=9.0)
    sync_api.expect(page.locator("#goal-told")).to_have_text("blocked: a chair")
    assert page.locator("#goal").get_attribute("role") is None
