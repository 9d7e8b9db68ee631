"""Makes the pictures of the page, from a simulated ChefBot in the flat: docs/_site/page_screens.py [FOLDER [NAME ...]].

It needs Chromium and Playwright. The robot knows its map, has places, zones and a program, and is on its way to a table.
"""

import asyncio
import shutil
import sys
import tempfile
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final

from msgspec import Struct
from playwright.async_api import Page, async_playwright

from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.client import Client
from chefbotd.transport.ports import reserve_port
from examples import order
from examples.waiter.__main__ import prepare

DESKTOP: Final = (1366, 768)
PHONE: Final = (390, 844)
ZONES: Final[tuple[Mapping[str, Any], ...]] = (
    {"kind": "keep_out", "name": "stairs", "points_m": [[3.2, 0.4], [4.6, 0.4], [4.6, 1.3], [3.2, 1.3]]},
    {
        "kind": "slow",
        "name": "hall",
        "max_speed_m_s": 0.15,
        "points_m": [[5.6, 3.3], [9.0, 3.3], [9.0, 4.2], [5.6, 4.2]],
    },
)
DRAWN_S = 2.0
"""Until the browser has drawn what came in."""

MIDDLE: Final = (
    "[room.offsetLeft + room.clientWidth / 2, view.getBoundingClientRect().top + room.clientHeight / 2]"
)
PLOTTED_S: Final = 8.0
BETWEEN_TAPS_S: Final = 0.5
STRAIGHT_RAD_S: Final = 0.15
STRAIGHT_WITHIN_S: Final = 60.0
CHECKED_S: Final = 0.05


class Screen(Struct, frozen=True):
    """A picture: the size of the window, the colours, the panel that is open, whether the whole map is shown.

    With ``is_drawing`` a zone is being drawn, of which four corners stand on the map.
    """

    size: tuple[int, int]
    panel: str = ""
    scheme: str = "light"
    whole_map: bool = True
    is_drawing: bool = False
    goal: str = "table 3"


SCREENS: Final[Mapping[str, Screen]] = {
    "page.png": Screen(DESKTOP, "goals"),
    "page_zones.png": Screen(DESKTOP, "map", "dark", goal="kitchen"),
    "page_workshop.png": Screen(DESKTOP, "workshop", whole_map=False, goal="table 3"),
    "page_phone.png": Screen(PHONE, "drive", goal="table 2"),
    "page_phone_zone.png": Screen(PHONE, "map", goal="table 3", is_drawing=True),
    "page_phone_dark.png": Screen(PHONE, "goals", "dark", goal="kitchen"),
}


@asynccontextmanager
async def robot_in_the_flat(environment: Mapping[str, str]) -> AsyncIterator[tuple[str, Client]]:
    """The address of the page, and a client of the robot, which is about to reach a table."""
    port = reserve_port()
    with tempfile.TemporaryDirectory() as folder:
        page = {"CHEFBOTD_PAGE__ENABLED": "true", "CHEFBOTD_PAGE__PORT": str(port)}
        all_of_it = {**order.environment(Path(folder) / "maps"), **page, **environment}
        async with (
            simulated_daemon("chefbot_lidar", all_of_it, own_clock=True) as (where, _),
            Client.connect(where.host, where.port, name="restaurant") as robot,
        ):
            await prepare(robot)
            for zone in ZONES:
                await robot.call("save_zone", **zone, confirmed=True)
            yield f"http://127.0.0.1:{port}/", robot


async def show(page: Page, screen: Screen) -> None:
    """Open the panel, and wait until all is drawn."""
    await page.wait_for_selector("#tab-goals:visible")
    opened = await page.locator("#rail [aria-expanded=true]").count()
    if screen.panel:
        tab = page.locator(f"#tab-{screen.panel}")
        if await tab.get_attribute("aria-expanded") != "true":
            await tab.click()
    elif opened:
        await page.locator("#rail [aria-expanded=true]").click()
    await asyncio.sleep(DRAWN_S)
    if screen.whole_map:
        await page.locator("#whole-map").click()
    await asyncio.sleep(DRAWN_S)
    if screen.panel == "workshop":
        await plot_speed(page)
    if screen.is_drawing:
        await draw_zone(page)


async def plot_speed(page: Page) -> None:
    """Plot how fast the robot drives, for some seconds."""
    await page.locator("#plot-topic").select_option("odometry")
    await page.locator("#plot-number option").first.wait_for(state="attached")
    await page.locator("#plot-number").select_option(label="linear m s")
    await page.locator("#plot-form button").click()
    await page.locator("#plot-span").select_option("10")
    await asyncio.sleep(PLOTTED_S)


async def draw_zone(page: Page) -> None:
    """Begin a slow area, and put four corners beside the middle of the map."""
    await page.locator("#zone-slow").click()
    await asyncio.sleep(DRAWN_S)
    await page.locator("#whole-map").click()
    await asyncio.sleep(DRAWN_S)
    x, y = await page.evaluate(
        "[view.clientWidth / 2, view.getBoundingClientRect().top + room.clientHeight / 2]"
    )
    for right, down in ((-110, 22), (-60, 22), (-60, 50), (-110, 50)):
        await page.touchscreen.tap(x + right, y + down)
        await asyncio.sleep(BETWEEN_TAPS_S)


async def wait_until_straight(robot: Client) -> None:
    """Wait until the robot drives straight: the lidar's points, drawn where it is now, lie on the walls then."""
    async with asyncio.timeout(STRAIGHT_WITHIN_S):
        while True:
            odometry = (await robot.get_state()).odometry
            if abs(odometry.angular_rad_s) < STRAIGHT_RAD_S:
                return
            await asyncio.sleep(CHECKED_S)


async def draw_screens(folder: Path, screens: Mapping[str, Screen]) -> None:
    """Have the robot drive, and draw each screen."""
    async with robot_in_the_flat({}) as (url, robot), async_playwright() as playwright:
        browser = await playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        for name, screen in screens.items():
            width, height = screen.size
            context = await browser.new_context(
                viewport={"width": width, "height": height},
                color_scheme=screen.scheme,
                has_touch=width < height,
            )
            page = await context.new_page()
            await page.goto(url)
            await robot.call("navigate_to", place=screen.goal)
            await show(page, screen)
            await wait_until_straight(robot)
            await page.screenshot(path=folder / name)
            await context.close()
        await browser.close()


if __name__ == "__main__":
    chosen = {name: SCREENS[name] for name in sys.argv[2:]} or SCREENS
    asyncio.run(draw_screens(Path(*sys.argv[1:2] or ["docs/images"]), chosen))
