"""Makes the pictures of the page, from a simulated ChefBot in the flat: docs/_site/page_screens.py [FOLDER [NAME ...]].

It needs Chromium and Playwright. The robot knows its map, has places, zones and a program, and is on its way to a table.
"""

import asyncio
import shutil
import sys
import tempfile
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal

from msgspec import Struct
from playwright.async_api import Page, async_playwright

from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.client import Client
from chefbotd.transport.ports import reserve_port
from examples import order
from examples.waiter.__main__ import prepare
from examples.waiter.notebook import Notebook
from examples.waiter.waiter import Waiter

DESKTOP: Final = (1366, 768)
PHONE: Final = (390, 844)
TOKEN: Final = "a" * 32
"""Of a robot that ends with the pictures."""

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


class Screen(Struct, frozen=True):
    """A picture: size, colours and language of the window, the panel that is open, whether the whole map is shown.

    With ``is_drawing`` a zone is being drawn, of which four corners stand on the map. ``role`` is who looks where tokens
    are asked for: an administrator invites a phone, a guest has been let in.
    """

    size: tuple[int, int]
    panel: str = ""
    scheme: Literal["light", "dark"] = "light"
    language: str = "en-GB"
    whole_map: bool = True
    is_drawing: bool = False
    role: Literal["", "admin", "guest"] = ""
    goal: str = "table 3"


SCREENS: Final[Mapping[str, Screen]] = {
    "page.png": Screen(DESKTOP, "goals"),
    "page_zones.png": Screen(DESKTOP, "map", "dark", goal="kitchen"),
    "page_workshop.png": Screen(DESKTOP, "workshop", whole_map=False, goal="table 3"),
    "page_phone.png": Screen(PHONE, "drive", goal="table 2"),
    "page_phone_zone.png": Screen(PHONE, "map", goal="table 3", is_drawing=True),
    "page_phone_dark.png": Screen(PHONE, "goals", "dark", goal="kitchen"),
    "page_drive.png": Screen(DESKTOP, "drive", goal="table 1"),
    "page_camera.png": Screen(DESKTOP, "camera", goal="table 2"),
    "page_programs.png": Screen(DESKTOP, "programs", goal="kitchen"),
    "page_lately.png": Screen(DESKTOP, "lately", "dark", goal="table 3"),
    "page_arabic.png": Screen(DESKTOP, "goals", language="ar", goal="table 1"),
    "page_phone_lies.png": Screen(PHONE[::-1], "drive", goal="table 2"),
    "page_people.png": Screen(DESKTOP, "people", role="admin"),
    "page_phone_guest.png": Screen(PHONE, "programs", role="guest"),
}


@asynccontextmanager
async def robot_in_the_flat(*, asks_for_tokens: bool) -> AsyncIterator[tuple[str, Client]]:
    """The address of the page, and a client of the robot, which is about to reach a table. The waiter takes orders."""
    port = reserve_port()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environment = {
            **order.environment(folder / "maps"),
            "CHEFBOTD_PAGE__ENABLED": "true",
            "CHEFBOTD_PAGE__PORT": str(port),
            "CHEFBOTD_CAMERA__ENABLED": "true",
            **(access(folder) if asks_for_tokens else {}),
        }
        async with simulated_daemon("chefbot_lidar", environment, own_clock=True) as (where, _):
            connect = partial(
                Client.connect, where.host, where.port, token=TOKEN if asks_for_tokens else None
            )
            async with connect(name="restaurant") as robot:
                await prepare(robot)
                for zone in ZONES:
                    await robot.call("save_zone", **zone, confirmed=True)
                waiter = Waiter(Notebook(folder / "orders.json"))
                serves = asyncio.create_task(waiter.run(partial(connect, name="waiter")))
                yield f"http://127.0.0.1:{port}/", robot
                serves.cancel()


def access(folder: Path) -> dict[str, str]:
    """Ask for tokens, of which there is the administrator's, and let phones in by invitations."""
    tokens = folder / "tokens"
    tokens.touch(mode=0o600)
    tokens.write_text(f"admin {TOKEN}\n")
    return {
        "CHEFBOTD_API__TOKEN_FILE": str(tokens),
        "CHEFBOTD_INVITATIONS__ENABLED": "true",
        "CHEFBOTD_INVITATIONS__FOLDER": str(folder / "invitations"),
    }


async def come_in(page: Page, url: str, robot: Client, role: str) -> None:
    """Open the page as who looks at it."""
    if role == "guest":
        await page.goto((await robot.call("make_invitation", role="guest", name="Ann"))["link"])
        await page.get_by_role("button", name="Come in").tap()
        return
    await page.goto(url)
    if role == "admin":
        await page.locator("#token").fill(TOKEN)
        await page.locator("#token").press("Enter")


async def show(page: Page, screen: Screen) -> None:
    """Open the panel, and wait until all is drawn."""
    await page.wait_for_selector(f"#tab-{screen.panel or 'goals'}:visible")
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
    if screen.panel == "programs":
        await page.get_by_role("button", name="Go on").click()  # our goal has ended the waiter's way home
        await page.get_by_role("button", name="Order to table 2").click()
        await asyncio.sleep(DRAWN_S)
    if screen.panel == "people":
        await page.get_by_role("button", name="Make an invitation").click()
        await page.locator("#invite-qr").wait_for()


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


async def draw_screens(folder: Path, screens: Mapping[str, Screen]) -> None:
    """Have the robot drive, and draw each screen."""
    for asks_for_tokens in (False, True):
        chosen = {name: screen for name, screen in screens.items() if bool(screen.role) == asks_for_tokens}
        if chosen:
            async with robot_in_the_flat(asks_for_tokens=asks_for_tokens) as (url, robot):
                await draw_screens_of(url, robot, folder, chosen)


async def draw_screens_of(url: str, robot: Client, folder: Path, screens: Mapping[str, Screen]) -> None:
    """Draw the screens of one robot."""
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        for name, screen in screens.items():
            width, height = screen.size
            context = await browser.new_context(
                viewport={"width": width, "height": height},
                color_scheme=screen.scheme,
                locale=screen.language,
                has_touch=screen.size != DESKTOP,
            )
            page = await context.new_page()
            await come_in(page, url, robot, screen.role)
            await robot.call("navigate_to", place=screen.goal)
            await show(page, screen)
            await page.screenshot(path=folder / name)
            await context.close()
        await browser.close()


if __name__ == "__main__":
    chosen = {name: SCREENS[name] for name in sys.argv[2:]} or SCREENS
    asyncio.run(draw_screens(Path(*sys.argv[1:2] or ["docs/images"]), chosen))
