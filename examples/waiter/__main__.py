"""``make waiter``: a simulated ChefBot in the flat, its page with a button for each table, and the waiter.

Or ``python -m examples.waiter --connect HOST:PORT``: the waiter alone, for the robot of a daemon whose map has places of
the kind ``table`` and one of the kind ``home``.
"""

import argparse
import asyncio
import shutil
import subprocess
import sys
import tempfile
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from chefbotd.cli.common.context import run_until_signalled
from chefbotd.cli.common.echo import echo
from chefbotd.cli.drive.simulated_daemon import simulated_daemon, until_ready
from chefbotd.client import Client
from chefbotd.components.simulation.worlds.flat import FLAT
from examples import order
from examples.serve import MAP
from examples.waiter.notebook import Notebook
from examples.waiter.waiter import Waiter

PAGE_PORT = 7380


def aloud(text: str) -> None:
    """Say it with espeak-ng, where that is installed, and on the terminal."""
    echo(text)
    program = shutil.which("espeak-ng")
    if program is not None:
        subprocess.Popen([program, "--", text], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # noqa: S603 - no shell


@asynccontextmanager
async def voice(host: str, port: int) -> AsyncIterator[Callable[[str], None]]:
    """What says a sentence: chefbot-speech, which says aloud what any agent says, where that is installed."""
    if find_spec("chefbot_speech") is None:
        yield aloud
        return
    words = (sys.executable, "-m", "chefbot_speech.main", "--connect", f"{host}:{port}")
    program = await asyncio.create_subprocess_exec(*words)
    try:
        yield echo
    finally:
        if program.returncode is None:
            program.terminate()
        await program.wait()


def told_once(tell: Callable[[str], None]) -> Callable[[str], None]:
    """Tell only what is new."""
    last = ""

    def tell_new(text: str) -> None:
        nonlocal last
        if text != last:
            tell(text)
        last = text

    return tell_new


async def prepare(robot: Client) -> None:
    """Give the simulated robot its map and its places, and have it find out where it is."""
    await until_ready(robot, told_once(echo))
    await robot.import_map(str(MAP), FLAT.name)
    for name, pose in order.PLACES.items():
        await robot.save_place(
            name,
            pose.x_m,
            pose.y_m,
            pose.heading_rad,
            of_map=FLAT.name,
            kind="table" if name in order.TABLES else "home",
        )
    await robot.load_map(FLAT.name)
    localized = await robot.localize(turn=True)
    echo(f"The robot is {localized.state} on its map: {localized.reason or 'it knows where it is'}.")


async def in_the_flat(folder: Path, page_port: int) -> None:
    """The simulated restaurant, until it is ended."""
    environment = order.environment(folder / "maps") | {
        "CHEFBOTD_PAGE__ENABLED": "true",
        "CHEFBOTD_PAGE__PORT": str(page_port),
        "CHEFBOTD_CAMERA__ENABLED": "true",  # it draws only while somebody looks
    }
    async with simulated_daemon("chefbot_lidar", environment, own_clock=True) as (where, _):
        async with Client.connect(where.host, where.port, name="restaurant") as robot:
            await prepare(robot)
        echo(f"Order at http://127.0.0.1:{page_port}/ (Ctrl-C ends all of it).")
        connect = partial(Client.connect, where.host, where.port, name="waiter")
        async with voice(where.host, where.port) as speak:
            await Waiter(Notebook(folder / "orders.json"), speak).run(connect)


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(
        prog="python -m examples.waiter", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument(
        "--connect", metavar="HOST:PORT", help="the robot's daemon; without it, one is simulated"
    )
    parser.add_argument("--token-file", type=Path, help="a file with a token of the role agent")
    parser.add_argument("--orders", type=Path, default=Path("orders.json"), help="where the orders are kept")
    parser.add_argument("--page-port", type=int, default=PAGE_PORT, help="of the simulated robot's page")
    options = parser.parse_args()
    try:
        if options.connect is None:
            with tempfile.TemporaryDirectory(prefix="chefbot-waiter-") as folder:
                run_until_signalled(in_the_flat(Path(folder), options.page_port))
        else:
            host, _, port = options.connect.rpartition(":")
            words = options.token_file.read_text().split() if options.token_file else [None]
            connect = partial(Client.connect, host, int(port), token=words[-1], name="waiter")
            speak = aloud if find_spec("chefbot_speech") is None else echo
            run_until_signalled(Waiter(Notebook(options.orders), speak).run(connect))
    except KeyboardInterrupt:
        echo("The waiter goes.")


if __name__ == "__main__":
    main()
