"""The card of the camera, in a real browser before the real program, whose robot draws what it sees."""

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

CAMERA = "\n[camera]\nenabled = true\n"
COLOURS = """() => {
  const { width, height } = document.getElementById("camera-picture");
  const { data } = document.getElementById("camera-picture").getContext("2d").getImageData(0, 0, width, height);
  return [width, height, new Set(new Uint32Array(data.buffer)).size];
}"""


def test_the_picture_is_shown_with_its_age_and_not_asked_for_out_of_sight(page: Any, tmp_path: Path) -> None:
    """What the robot sees is on the card, also with a token; a closed panel asks for nothing."""
    robot = RunningRobot(tmp_path, token="driver-token-0123456789", role="drive", more=CAMERA)
    try:
        with robot.client() as client:
            page.add_init_script("sessionStorage.setItem('chefbotd-token', 'driver-token-0123456789')")
            open_page(page, robot)
            show(page, "camera")
            card = page.locator("#camera-part")
            sync_api.expect(page.locator("#camera-picture")).to_be_visible()
            sync_api.expect(card).to_contain_text("s old")
            width, height, colours = page.evaluate(COLOURS)
            assert (width, height) == (320, 240)
            assert colours > 10
            assert client.call("get_camera_status")["viewers"] == 1
            assert barriers(page) == []
            page.set_viewport_size({"width": 360, "height": 740})
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
            show(page, "drive")
            assert until(lambda: client.call("get_camera_status")["state"] == "off")
            assert client.call("get_camera_status")["viewers"] == 0
    finally:
        robot.end()
