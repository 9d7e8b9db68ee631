"""``python -m examples.ros2``: a simulated ChefBot in the flat, with its map, for RViz; README.md says what to start."""

import asyncio
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from chefbotd.cli.common.context import run_until_signalled
from chefbotd.cli.common.echo import echo
from chefbotd.cli.drive.simulated_daemon import simulated_daemon, until_ready
from chefbotd.client import Client
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.core.geometry import Pose2D
from examples.serve import MAP

PATIENCE_S = 3.0
"""A busy computer holds up the simulated robot together with its daemon."""


@asynccontextmanager
async def robot_in_the_flat(folder: Path, start: Pose2D = FLAT.start) -> AsyncIterator[int]:
    """The port of its daemon. It has its map, and is not told where it stands: the first button does that."""
    environment = {
        "CHEFBOTD_MAPS__FOLDER": str(folder),
        "CHEFBOTD_LOCALIZATION__AUTO_SEARCH": "false",
        "CHEFBOTD_SAFETY__SOURCES__ROS2__PRIORITY": "4",
        "CHEFBOTD_SAFETY__SOURCES__ROS2__TIMEOUT_S": "0.5",
        "CHEFBOTD_SIM__WORLD__MAP_PATH": FLAT.name,
        "CHEFBOTD_SIM__WORLD__START_X_M": repr(start.x_m),
        "CHEFBOTD_SIM__WORLD__START_Y_M": repr(start.y_m),
        "CHEFBOTD_SIM__WORLD__START_HEADING_RAD": repr(start.heading_rad),
        "CHEFBOTD_WATCHDOG__TIMEOUT_S": repr(PATIENCE_S),
        "CHEFBOTD_WORKER__NICENESS": "0",
    }
    async with simulated_daemon("chefbot_lidar", environment) as (where, _):
        async with Client.connect(where.host, where.port, name="preparation") as robot:
            await until_ready(robot, lambda text: None)
            await robot.import_map(str(MAP), FLAT.name)
            await robot.load_map(FLAT.name)
        yield where.port


async def main() -> None:
    """Until it is ended."""
    with tempfile.TemporaryDirectory(prefix="chefbot-ros2-") as folder:
        async with robot_in_the_flat(Path(folder)) as port:
            start = FLAT.start
            echo(
                f"The robot stands at x {start.x_m:g} m, y {start.y_m:g} m, heading {start.heading_rad:.1f} rad."
            )
            echo(f"ros2 launch examples/ros2/launch.py connect:=127.0.0.1:{port}")
            echo("Ctrl-C ends it.")
            await asyncio.Event().wait()


if __name__ == "__main__":
    try:
        run_until_signalled(main())
    except KeyboardInterrupt:
        echo("The robot goes.")
