"""``python -m chefbot_fleet.demo``: exit code 1 if an order was lost or done twice, or something touched."""

import asyncio
import logging
import signal
import sys
import tempfile
from pathlib import Path

import click
import structlog

from chefbot_fleet.demo.chefbots import ChefBot
from chefbot_fleet.demo.programs import shared_clock
from chefbot_fleet.demo.story import STARTS, TOKEN, Demonstration


@click.command()
@click.option("--orders", default=60, show_default=True)
@click.option("--robots", type=click.IntRange(1, len(STARTS)), default=len(STARTS), show_default=True)
@click.option("--port", default=7340, show_default=True, help="of the page")
@click.option("--pace", default=1.0, show_default=True, help="of the robots' clock at most; 1: real time")
@click.option(
    "--logs", type=click.Path(file_okay=False, path_type=Path), help="a new folder for all programs' files"
)
def demonstrate(orders: int, robots: int, port: int, pace: float, logs: Path | None) -> None:
    """Six simulated robots bring orders in an office, while a robot, the broker and the manager are killed."""
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.ERROR))
    click.echo(f"{robots} simulated ChefBots in an office: http://127.0.0.1:{port} (token: {TOKEN})")
    with tempfile.TemporaryDirectory(prefix="chefbot-fleet-") as temporary:
        folder = logs or Path(temporary)
        folder.mkdir(exist_ok=True)
        passed = asyncio.run(_run(folder.absolute(), orders, robots, port, pace))
    sys.exit(0 if passed else 1)


async def _run(folder: Path, orders: int, robots: int, port: int, pace: float) -> bool:
    task = asyncio.current_task()
    if task is not None:
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    clock = shared_clock(folder, pace)
    await clock.start()
    try:
        return await Demonstration(folder, ChefBot, robots=robots, count=orders, page_port=port).run()
    finally:
        await clock.kill()


if __name__ == "__main__":
    demonstrate()
