"""Every panel of a robot that has everything, for who uses the keyboard alone, a screen reader, or 200 %."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.scenarios.page.browser import NEEDS_BROWSER, RunningRobot, barriers, mode_is, show, sync_api

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]
PANELS = ("drive", "goals", "map", "camera", "lately", "people", "workshop")
SIZES = [(1366, 768), (683, 384), (390, 844), (320, 568)]
"""A desktop, the same at 200 %, a phone, and the narrowest window of WCAG 2.2 (1.4.10, reflow)."""
TOKEN = "a" * 32

ACTIVE = """() => {
  const part = document.activeElement;
  const { left, right, top, bottom } = part.getBoundingClientRect();
  const x = (Math.max(left, 0) + Math.min(right, innerWidth)) / 2;
  const y = (Math.max(top, 0) + Math.min(bottom, innerHeight)) / 2;
  const above = document.elementFromPoint(x, y);
  const isLarge = ["view", "panels", "lately"].includes(part.id); // others stand on them
  const isSeen = isLarge || part.contains(above) || [...part.labels ?? []].some((label) => label.contains(above));
  const panel = part.closest(".panel")?.id ?? "";
  return [part === document.body ? "" : part.id || part.outerHTML.slice(0, 90), panel, isSeen];
}"""
ENABLED = """(panel) => [...document.querySelectorAll(`#panel-${panel} :is(button, input, select, textarea)`)]
  .filter((part) => part.checkVisibility({ visibilityProperty: true }) && !part.disabled)
  .map((part) => part.id || part.outerHTML.slice(0, 90))"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningRobot]:
    """A robot with a lidar, maps, a camera, invitations and notifications; its page is an administrator's."""
    folder: Path = tmp_path_factory.mktemp("robot")
    more = (
        "\n[camera]\nenabled = true\n"
        f'\n[invitations]\nenabled = true\nfolder = "{folder}/invitations"\n'
        '\n[notifications]\nenabled = true\nwebhook_url = "http://127.0.0.1:9/x"\n'
    )
    running = RunningRobot(folder, token=TOKEN, name="chefbot_lidar", more=more)
    yield running
    running.end()


def open_panels(page: Any, robot: RunningRobot, size: tuple[int, int]) -> None:
    """Open the page in a window of this size, with every panel there."""
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.add_init_script(f"sessionStorage.setItem('chefbotd-token', '{TOKEN}')")
    page.goto(robot.url)
    mode_is(page, "Ready to drive")
    for panel in PANELS:
        sync_api.expect(page.locator(f"#tab-{panel}")).to_be_visible()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_no_panel_has_a_barrier_that_axe_can_find(
    page: Any, robot: RunningRobot, size: tuple[int, int], scheme: str
) -> None:
    """Names, roles, contrast and order; and nothing sticks out sideways."""
    page.emulate_media(color_scheme=scheme)
    open_panels(page, robot, size)
    for panel in PANELS:
        show(page, panel)
        page.wait_for_timeout(200)  # until a sheet is as high as it gets
        assert (panel, barriers(page)) == (panel, [])
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), panel


@pytest.mark.parametrize("size", SIZES)
def test_the_keyboard_alone_reaches_all_of_every_panel_in_sight(
    page: Any, robot: RunningRobot, size: tuple[int, int]
) -> None:
    """Each control that can be used takes the focus by the tabulator key, and is seen while it has it."""
    open_panels(page, robot, size)
    for panel in PANELS:
        page.locator(f"#tab-{panel}").focus()
        if page.locator(f"#tab-{panel}").get_attribute("aria-expanded") != "true":
            page.keyboard.press("Enter")
        sync_api.expect(page.locator(f"#panel-{panel}")).to_be_visible()
        page.wait_for_timeout(200)
        reached, hidden = set(), []
        for _ in range(150):
            page.keyboard.press("Tab")
            name, _, is_seen = page.evaluate(ACTIVE)
            reached.add(name)
            if name and not is_seen:
                hidden.append(name)
            if name == "stop":
                break
        assert (panel, hidden) == (panel, [])
        assert set(page.evaluate(ENABLED, panel)) - reached == set(), panel
