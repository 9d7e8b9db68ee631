"""Calibrates a simulated robot that is wrong in everything, and holds the results against the truth."""

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING

from structlog.testing import capture_logs

from chefbotd.cli.common import output
from chefbotd.cli.common.context import CommandContext, refusal
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import require
from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.components.calibration.cli.report import draw_plots, finish, require_plots, show_estimates

if TYPE_CHECKING:
    from examples.calibrate import Calibrated, SquareError


def calibrate_simulated(context: CommandContext, seed: int, out: Path) -> None:
    """Calibrate the robot of this seed on the virtual clock, and show what came of it.

    Raises:
        ProgramError: a step has not passed, or an optional part is missing.
    """
    require("maps", "PIL")
    require("tune", "tomlkit")
    require_plots(out)
    require("navigation", "numba", "scipy")
    from examples.calibrate import calibrate

    out.mkdir(parents=True, exist_ok=True)
    began_s = time.monotonic()

    def say(text: str) -> None:
        if not context.as_json:
            echo(text)

    say(f"A simulated ChefBot, drawn from the seed {seed}, calibrates itself in a furnished flat.")
    with capture_logs():
        try:
            calibrated = run_virtual(calibrate(seed, out, say))
        except CallError as error:
            raise refusal(error) from error
    pictures = draw_plots(calibrated.results, out)
    if context.as_json:
        output.say(True, calibrated, "")
    else:
        _print(calibrated, pictures, time.monotonic() - began_s)
    finish(context, [] if context.as_json else calibrated.results)


def _print(calibrated: "Calibrated", pictures: list[Path], passed_s: float) -> None:
    show_estimates(
        [estimate for result in calibrated.results for estimate in result.estimates], calibrated.true
    )
    echo("'true' is what the simulated robot is; 'off' by how many sigmas the result misses it.")
    echo("Odometry at the end of a 4 m square, against the truth:")
    for before, after in zip(calibrated.before, calibrated.after, strict=True):
        direction = "clockwise" if before.clockwise else "counter-clockwise"
        echo(f"  {direction}: {_off(before)} before, {_off(after)} after")
    echo(
        f"  Random slip alone, which no calibration removes: {math.degrees(calibrated.slip_rad):.1f} degrees (sigma)."
    )
    echo(f"The robot took {calibrated.robot_s / 60:.1f} minutes of its time, this computer {passed_s:.0f} s.")
    echo(f"Its configuration: {calibrated.config}. Plots: {len(pictures)} in {calibrated.config.parent}.")


def _off(square: "SquareError") -> str:
    return f"{1000 * square.distance_m:.0f} mm and {math.degrees(square.heading_rad):.2f} degrees"
