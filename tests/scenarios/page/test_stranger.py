"""The card of a stranger's component (tests/stranger) on the page of the real program."""

import os
from pathlib import Path
from typing import Any

import pytest

from tests.scenarios.page.browser import NEEDS_BROWSER, RunningRobot, mode_is, open_page, sync_api

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]
STRANGER = Path(__file__).parents[2] / "stranger"


def test_its_card_stands_where_it_says_shows_its_topic_and_calls_its_method(
    page: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It appears with the first rise of the pressure, before the card for driving, and its button is answered."""
    sensor = tmp_path / "hpa"
    sensor.write_text("1000.0")
    searched = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(STRANGER), searched])))
    robot = RunningRobot(tmp_path, allow="pressure", more=f'\n[pressure]\nfile = "{sensor}"\n')
    try:
        open_page(page, robot)
        sync_api.expect(page.locator("#pressure-part")).to_be_hidden()
        sensor.write_text("1001.5")
        card = page.locator("#pressure-part + #driving")
        sync_api.expect(page.locator("#pressure-part")).to_be_visible()
        sync_api.expect(page.locator("#pressure-part p")).to_have_text("1001.5 hPa, 1 rises")
        assert card.count() == 1
        page.get_by_role("button", name="Count from zero").click()
        sync_api.expect(page.locator("#pressure-part p")).to_have_text("counting from zero")
        mode_is(page, "Ready to drive")
    finally:
        robot.end()


def test_a_card_that_cannot_be_loaded_is_left_out_and_the_page_works(
    page: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopping and driving need no component."""
    broken = tmp_path / "path"
    broken.mkdir()
    for entry in STRANGER.iterdir():
        (broken / entry.name).symlink_to(entry)
    (broken / "chefbot_pressure").unlink()
    (broken / "chefbot_pressure").mkdir()
    for entry in (STRANGER / "chefbot_pressure").iterdir():
        if entry.is_file():
            (broken / "chefbot_pressure" / entry.name).write_bytes(entry.read_bytes())
    (broken / "chefbot_pressure" / "card.js").write_text("throw new Error('broken');")
    (tmp_path / "hpa").write_text("1000.0")
    monkeypatch.setenv("PYTHONPATH", str(broken))
    more = f'\n[pressure]\nfile = "{tmp_path / "hpa"}"\n'
    robot = RunningRobot(tmp_path, allow="pressure", more=more)
    try:
        open_page(page, robot)
        page.get_by_role("button", name="Stop Space").click()
        sync_api.expect(page.locator("#pressure-part")).to_be_hidden()
    finally:
        robot.end()
