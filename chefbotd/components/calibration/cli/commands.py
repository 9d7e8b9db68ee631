"""The command ``chefbotctl calibrate``."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import click

from chefbotd.cli.common.arguments import finite
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.exits import Exit, ProgramError, require

LOOPS = "umbmark.loops"
NAMES = ("encoders", "battery", "motors", "wheels", "umbmark", "lidar", "imu", "sensors")
"""The steps, repeated here so that chefbotctl need not import them."""


MOST_SPACE_M: Final = 100.0


def free_floor(text: str | float) -> float:
    """A distance that the daemon takes: a finite number in its range."""
    space_m = finite(text)
    if not 0 <= space_m <= MOST_SPACE_M:
        raise click.BadParameter(f"{text!r} is not in the range 0 to {MOST_SPACE_M:g} m")
    return space_m


@click.command()
@click.argument("steps", nargs=-1, metavar="[STEP]...", type=click.Choice(NAMES))
@click.option("--apply", "applies", is_flag=True, help="Write what has passed into the configuration.")
@click.option(
    "--space", "space_m", type=free_floor, metavar="M",
    help="Free floor around the robot, where no lidar sees that.",
)  # fmt: skip
@click.option(
    "--yes", "is_ready", is_flag=True, help="Everything is prepared: ask for measured numbers only."
)
@click.option(
    "--from", "recording", type=click.Path(exists=True, dir_okay=False, path_type=Path), metavar="FILE",
    help="Calibrate from a recorded drive; nothing moves, and no daemon is needed.",
)  # fmt: skip
@click.option(
    "--loops", "has_loops", is_flag=True,
    help="With --from: the drive is of loops that ended where they began (step umbmark).",
)  # fmt: skip
@click.option(
    "--config", type=click.Path(exists=True, dir_okay=False, writable=True, path_type=Path), metavar="FILE",
    help="With --apply: the configuration to write, on this computer; else the daemon writes its own.",
)  # fmt: skip
@click.option(
    "--sim", "seed", type=click.IntRange(0), metavar="SEED",
    help="Show it on a simulated robot that is drawn at random from SEED; no robot and no daemon is needed.",
)  # fmt: skip
@click.option(
    "--out", type=click.Path(file_okay=False, path_type=Path), metavar="FOLDER",
    help="Draw the plots as PNG files into FOLDER.",
)  # fmt: skip
@click.pass_obj
def calibrate(
    context: CommandContext,
    steps: tuple[str, ...],
    applies: bool,
    space_m: float | None,
    is_ready: bool,
    recording: Path | None,
    has_loops: bool,
    config: Path | None,
    seed: int | None,
    out: Path | None,
) -> None:
    """Find the robot's real parameters: STEP is encoders, battery, motors, wheels, umbmark, lidar, imu or sensors.

    Without a STEP all are done, in this order. The robot moves; any stop ends a step. Each step says what to prepare,
    and shows each parameter before and after with its standard deviation. Nothing is written without --apply.
    """
    if seed is not None:
        if steps or applies or recording is not None:
            raise click.UsageError("--sim does every step, and takes no other option but --out")
        if find_spec("examples") is None or find_spec("examples.calibrate_report") is None:
            what = "--sim is a demonstration, which only the sources of chefbotd have"
            raise ProgramError(Exit.NOT_INSTALLED, f"{what}: run 'make calibrate' in a checkout")
        report = import_module("examples.calibrate_report")
        report.calibrate_simulated(context, seed, out or Path("build/calibration"))
        return
    if config is not None and not applies:
        raise click.UsageError("--config names the file to write, which needs --apply")
    if config is not None:
        require("tune", "tomlkit")
    if has_loops and (recording is None or steps != ("umbmark",)):
        raise click.UsageError("--loops is for 'calibrate umbmark --from FILE'")
    if recording is not None:
        from chefbotd.components.calibration.cli.recorded import calibrate_recorded

        answers = {LOOPS: 1.0} if has_loops else {}
        calibrate_recorded(
            context, recording, steps, config if applies else None, out, answers, applies=applies
        )
        return
    from chefbotd.components.calibration.cli.session import CalibrationSession

    CalibrationSession(context, steps, space_m, is_ready=is_ready).run(config, out, applies=applies)
