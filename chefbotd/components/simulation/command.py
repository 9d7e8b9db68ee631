"""The command ``chefbotd simulate``, and the check that a robot can be simulated."""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING

import click

from chefbotd.cli.common.arguments import PHYSICS, configuration
from chefbotd.cli.common.exits import Exit, ProgramError, extra
from chefbotd.cli.programs.load import load_valid
from chefbotd.cli.programs.program import wants_json
from chefbotd.components.simulation.component import SKETCH, SKETCHES, WHICH_PHYSICS

if TYPE_CHECKING:
    from chefbotd.components.simulation.simulation import Simulation
    from chefbotd.settings import Settings

CYCLE_HZ = click.FloatRange(0.1, 1000.0)


def check_simulation(settings: "Settings") -> "Simulation":
    """The simulation that this configuration describes.

    Raises:
        ProgramError: it cannot be simulated, or what it needs is not installed: Pillow for a map, MuJoCo for its
            physics; the message says why.
    """
    from chefbotd.components.simulation.process.simulated_robot import CannotSimulateError, checked_simulation

    try:
        with extra("maps", "PIL"), extra("mujoco", "mujoco"):
            return checked_simulation(settings)
    except CannotSimulateError as error:
        raise ProgramError(Exit.BAD_CONFIGURATION, str(error)) from error


@click.command()
@click.option(
    "--config",
    "path",
    metavar="FILE|ROBOT",
    type=configuration,
    help="The robot's TOML file, or the name of a packaged one; ChefBot by default.",
)
@click.option(
    "--link", type=click.Path(path_type=Path), help="A symbolic link to keep pointed at the device."
)
@click.option("--seed", type=click.IntRange(min=0), help="For the noise; the same seed, the same noise.")
@click.option("--sketch", type=click.Choice(SKETCHES), help=SKETCH)
@click.option("--physics", type=PHYSICS, help=WHICH_PHYSICS)
@click.option("--cycle-hz", type=CYCLE_HZ, metavar="HZ", help="How often the board reports, 0.1 to 1000.")
@click.pass_context
def simulate(
    ctx: click.Context,
    path: Path | None,
    link: Path | None,
    seed: int | None,
    sketch: str | None,
    physics: str | None,
    cycle_hz: float | None,
) -> None:
    """Run a simulated board, on a device of its own, and the robot's lidars, each on another.

    The board's path is the first line printed, the lidars' are the next. It obeys words on standard input, one a line:
    plug, unplug, truth, reset, quit.
    """
    cycle_s = None if cycle_hz is None else 1 / cycle_hz
    options = {"sim.board.sketch": sketch, "sim.board.cycle_s": cycle_s, "sim.physics": physics}
    settings = load_valid(path, {key: value for key, value in options.items() if value is not None})
    from chefbotd.components.simulation.simulate import simulate as run_board

    simulation = check_simulation(settings)
    try:
        asyncio.run(run_board(simulation, link_path=link, seed=seed, as_json=wants_json(ctx)))
    except (OSError, ValueError) as error:
        raise ProgramError(Exit.FAILED, str(error)) from error
