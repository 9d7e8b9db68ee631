"""Makes the pictures of README and the pages anew, from the programs: python docs/_site/pictures.py [FOLDER [NAME ...]].

NAME is square or tune; without any, both are made. Drawn are the table of ``make run``, and the tuning screen while the
wheels are excited. The page's pictures are made by ``page_screens.py``.
"""

import asyncio
import io
import sys
from pathlib import Path

from rich.console import Console
from rich.terminal_theme import MONOKAI

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.drive import course_driver, square_view
from chefbotd.cli.drive.course import square
from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.client import Client
from chefbotd.components.tuning.cli import tuning_screen
from chefbotd.components.tuning.cli.excitation import Wave
from chefbotd.components.tuning.cli.tuning_screen import Tune

COLUMNS, ROWS = 80, 24
SEEN_S = 12.0
"""Until curves and a path are long enough to be seen."""

MOST_TRIES = 10

PATIENT = {"CHEFBOTD_SAFETY__COMMAND_TIMEOUT_S": "2.0"}
"""So that a busy computer, which draws late, does not end the excitation."""


async def draw_square(file: Path) -> None:
    """What ``chefbotctl square --sim`` prints at its end."""
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), highlight=False, force_terminal=True)

    async def drive(client: Client) -> course_driver.CourseResult:
        return await course_driver.CourseDriver(client, lambda progress: None).drive_course(square(2.0))

    async with simulated_daemon() as (address, _):
        result = await CommandContext(address).with_client(drive)
    console.print("$ make run\nchefbotctl square --sim --robot chefbot")
    square_view.SquareView(False, console).show(result, [])
    console.save_svg(str(file), title="make run", theme=MONOKAI, unique_id="square")


async def draw_tuning(file: Path) -> None:
    """The tuning screen, with the wheels excited and one gain changed."""
    async with (
        simulated_daemon("chefbot", PATIENT, own_clock=True) as (address, _),
        Client.connect(address.host, address.port) as robot,
    ):
        await robot.wait_until_armed()
        screen = Tune(robot, "127.0.0.1:7333", None, Wave(0.1, 1.5))
        async with screen.run_test(size=(COLUMNS, ROWS)) as user:
            screen.title = "chefbotctl pid tune"
            tuning_screen.SHOWN_HZ = 4.0  # drawing is what costs time here
            await user.press("down", "right")
            for _ in range(MOST_TRIES):
                await asyncio.sleep(1.0)
                await user.press("e", "e")
                await asyncio.sleep(SEEN_S)
                if "excited" in screen.export_screenshot():
                    break  # else this program was late, and the excitation ended
            screen.save_screenshot(file.name, path=str(file.parent))


PICTURES = {
    "square": ("square.svg", draw_square),
    "tune": ("tune.svg", draw_tuning),
}


async def main(folder: Path, names: list[str]) -> None:
    """Draw these; all where none is named."""
    for name in names or PICTURES:
        file, draw = PICTURES[name]
        await draw(folder / file)


if __name__ == "__main__":
    asyncio.run(main(Path(*sys.argv[1:2] or ["docs/images"]), sys.argv[2:]))
