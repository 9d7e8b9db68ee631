"""The commands ``chefbotctl serve`` and ``chefbotctl map demo``."""

import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError, extra, require
from chefbotd.components.maps.cli.asking import write_file


@click.command()
@click.pass_obj
def serve(context: CommandContext) -> None:
    """Demo: a simulated ChefBot with a lidar serves three tables. No robot and no daemon is needed.

    It starts somewhere in a flat without being told where, finds out, goes to the tables and home to the kitchen.
    People walk about, and a chair that is on no map is in its way. At the end each leg is held against the truth.
    """
    require("navigation", "PIL")
    with extra("navigation", "numba", "llvmlite", "scipy"):
        from examples.serve import Serve
    from chefbotd.components.navigation.cli.view import NavigationView
    from examples import order
    from examples.serve_report import as_json, print_report

    view = NavigationView(quiet=context.as_json)
    with view.showing() as show:
        served = context.run(Serve((*order.TABLES, order.HOME), show).run())
    if context.as_json:
        echo(json.dumps(as_json(served)))
    else:
        print_report(view, served)
    if served.failures:
        raise ProgramError(Exit.NOT_DONE, "; ".join(served.failures))


@click.command()
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("build/map"),
    show_default=True,
    help="The folder for the map's files.",
)
@click.pass_obj
def demo(context: CommandContext, out: Path) -> None:
    """Demo: a simulated ChefBot with a lidar maps a flat. No robot and no daemon is needed.

    It is driven through the rooms, and the map is drawn as it grows. At the end the map is held against the flat's
    true walls. It takes about three minutes.
    """
    require("navigation", "PIL")
    from chefbotd.components.maps.cli.draw import MapMark
    from chefbotd.components.maps.cli.live_view import LiveMapView
    from chefbotd.components.maps.cli.png import to_png
    from chefbotd.components.simulation.scene import of_solids
    from chefbotd.components.simulation.worlds.building import SLICE_M
    from chefbotd.components.simulation.worlds.flat import FLAT
    from examples.map_demo import Demo
    from examples.map_report import as_json, print_report, wall_errors

    view = LiveMapView(quiet=context.as_json)
    with only_one_in(out), view.showing() as show:
        result = context.run(Demo(out, FLAT.name, FLAT.start, show).run())
    errors = wall_errors(result.grid, FLAT.start, of_solids(FLAT.solids).slice(SLICE_M)[0])
    picture = out / f"{FLAT.name}.png"
    robot = MapMark(result.pose.x_m, result.pose.y_m, result.pose.heading_rad)
    write_file(picture, to_png(result.grid, [robot]), force=True)
    files = [out / f"{FLAT.name}.yaml", out / f"{FLAT.name}.pgm", picture]
    if context.as_json:
        echo(json.dumps(as_json(result, errors, files)))
    else:
        print_report(view, result, errors, files)
    if result.missed_steps:
        raise ProgramError(Exit.NOT_DONE, f"{result.missed_steps} control steps were missed")


@contextmanager
def only_one_in(folder: Path) -> Iterator[None]:
    """Keep the folder from every other demonstration until the end, which the kernel sees to.

    Raises:
        ProgramError: another one has it, or it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder / ".demo.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise ProgramError(Exit.NOT_DONE, f"cannot write to {folder}: {error.strerror}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError:
        reason = (
            f"another demonstration is writing to {folder}: wait for it, or give another folder with --out"
        )
        raise ProgramError(Exit.NOT_DONE, reason) from None
    finally:
        os.close(descriptor)
