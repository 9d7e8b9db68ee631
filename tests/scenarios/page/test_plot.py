"""The card that plots any number, in a real browser before the real program."""

from pathlib import Path
from typing import Any

import pytest

from tests.scenarios.page.browser import (
    NEEDS_BROWSER,
    RunningRobot,
    barriers,
    open_page,
    show,
    sync_api,
    until,
)

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]

DRAWN = """() => {
  const canvas = document.getElementById("plot-lines");
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return data.filter((value, index) => index % 4 === 3 && value > 0).length;
}"""


def add(page: Any, topic: str, number: str) -> None:
    """Choose a number, and plot it, by the keyboard's means alone."""
    page.get_by_label("Topic").select_option(topic)
    sync_api.expect(page.locator("#plot-number option").first).to_be_attached()
    page.locator("#plot-number").select_option(label=number)
    page.get_by_role("button", name="Add", exact=True).press("Enter")


def test_numbers_are_plotted_kept_over_a_reload_and_cost_nothing_out_of_sight(
    page: Any, tmp_path: Path
) -> None:
    """Two lines with their latest values, the value at a time, a pause; a closed panel ends the connection."""
    robot = RunningRobot(tmp_path)
    try:
        with robot.client() as client:
            open_page(page, robot)
            show(page, "workshop")
            add(page, "battery", "voltage v")
            add(page, "odometry", "linear m s")
            add(page, "odometry", "linear m s")
            sync_api.expect(page.locator("#plot-told")).to_have_text("This line is there already.")
            rows = page.locator("#plot-rows tr")
            sync_api.expect(rows).to_have_count(2)
            sync_api.expect(rows.nth(0)).to_contain_text("battery: voltage v")
            sync_api.expect(rows.nth(0).locator("td").first).to_contain_text(" V")
            sync_api.expect(rows.nth(1).locator("td").first).to_have_text("0.0000 m/s")
            assert until(lambda: page.evaluate(DRAWN) > 100)
            back = page.get_by_label("Look back")
            back.press("ArrowLeft")
            sync_api.expect(page.locator("#plot-then")).to_have_text("0.2 s ago")  # 0.15 s, half a step up
            page.get_by_role("button", name="Pause").click()
            sync_api.expect(page.get_by_role("button", name="Pause")).to_have_attribute(
                "aria-pressed", "true"
            )
            page.locator("#plot-span").select_option("60")
            assert barriers(page) == []
            page.reload()
            sync_api.expect(rows).to_have_count(2)
            sync_api.expect(rows.nth(1).locator("td").first).to_have_text("0.0000 m/s")
            assert page.locator("#plot-span").input_value() == "60"
            assert until(lambda: client.call("get_stats")["clients"] == 3)
            show(page, "drive")
            assert until(lambda: client.call("get_stats")["clients"] == 2)
            show(page, "workshop")
            page.get_by_role("button", name="Remove battery: voltage v").press("Enter")
            sync_api.expect(rows).to_have_count(1)
            page.set_viewport_size({"width": 360, "height": 740})
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    finally:
        robot.end()
