"""The commands of ``chefbotctl map`` that make a map: start, pause, finish, discard, live, demo."""

import fcntl
import json
import os
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.common.extras import require
from chefbotd.cli.maps.asking import progress_bar, write_file
from chefbotd.client import Client

T = TypeVar("T")

NEEDS_LIDAR = "this robot makes no maps: its configuration has no [[lidar]], or [worker] enabled = false"


@click.command()
@click.argument("name", required=False)
@click.option("--unfinished", is_flag=True, help="Go on with the map that was never finished.")
@click.pass_obj
def start(context: CommandContext, name: str | None, unfinished: bool) -> None:
    """Begin a map, or go on with the saved map NAME, or after a pause.

    Drive the robot through the rooms then, by whatever means, and 'chefbotctl map finish NAME'.
    """
    told = _run(context, lambda robot: robot.start_mapping(name, unfinished=unfinished))
    begun = f"Mapping: {told.keyframes} scans so far." if told.keyframes else "Mapping."
    warning = f" Beware: {told.warning}." if told.warning else ""
    output.say(context.as_json, told.model_dump(), f"{begun} 'chefbotctl map live' shows the map.{warning}")


@click.command()
@click.pass_obj
def pause(context: CommandContext) -> None:
    """Add nothing to the map until 'map start'."""
    told = _run(context, lambda robot: robot.pause_mapping())
    output.say(context.as_json, told.model_dump(), f"Paused, with {told.keyframes} scans.")


@click.command()
@click.argument("name")
@click.pass_obj
def finish(context: CommandContext, name: str) -> None:
    """Match all scans once more, save the map as NAME, and end. Ctrl-C gives up, and mapping goes on."""
    with progress_bar(f"finishing {name}", quiet=context.as_json) as report:
        saved = _run(context, lambda robot: robot.finish_mapping(name, on_progress=report))
    text = f"Saved {saved.name}, version {saved.version}: {saved.keyframes} scans on {saved.path_m:.0f} m."
    output.say(context.as_json, saved.model_dump(), text)


@click.command()
@click.option("--yes", is_flag=True, help="Do not ask.")
@click.pass_obj
def discard(context: CommandContext, yes: bool) -> None:
    """Forget the map that is being made, or was never finished. Saved maps stay."""
    if not (yes or context.as_json):
        click.confirm("Forget the map that is being made?", abort=True, err=True)
    told = _run(context, lambda robot: robot.discard_mapping())
    output.say(context.as_json, told.model_dump(), "The map is discarded.")


@click.command()
@click.pass_obj
def live(context: CommandContext) -> None:
    """Draw the map that is being made, as it grows, with the robot in it, until Ctrl-C."""
    from chefbotd.cli.maps.demo_view import DemoView
    from chefbotd.cli.maps.tour import Tour, listen

    view = DemoView(quiet=context.as_json)

    async def watch(robot: Client) -> None:
        with view.showing() as show:
            await listen(robot, Tour(doing="mapping"), show)

    _run(context, watch)


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
    from chefbotd.cli.maps.against_truth import wall_errors
    from chefbotd.cli.maps.demo import Demo
    from chefbotd.cli.maps.demo_view import DemoView, as_json
    from chefbotd.cli.maps.draw import Mark
    from chefbotd.cli.maps.making import only_one_in
    from chefbotd.cli.maps.png import to_png
    from chefbotd.sim.scene import of_solids
    from chefbotd.sim.worlds.building import SLICE_M
    from chefbotd.sim.worlds.flat import FLAT

    view = DemoView(quiet=context.as_json)
    with only_one_in(out), view.showing() as show:
        result = context.run(Demo(out, FLAT.name, FLAT.start, show).run())
    errors = wall_errors(result.grid, FLAT.start, of_solids(FLAT.solids).slice(SLICE_M)[0])
    picture = out / f"{FLAT.name}.png"
    robot = Mark(result.pose.x_m, result.pose.y_m, result.pose.heading_rad)
    write_file(picture, to_png(result.grid, [robot]), force=True)
    files = [out / f"{FLAT.name}.yaml", out / f"{FLAT.name}.pgm", picture]
    if context.as_json:
        echo(json.dumps(as_json(result, errors, files)))
    else:
        view.show(result, errors, files)
    if result.missed_steps:
        raise ProgramError(Exit.NOT_DONE, f"{result.missed_steps} control steps were missed")


def _run(context: CommandContext, action: Callable[[Client], Awaitable[T]]) -> T:
    return context.run_with_client(action, absent=NEEDS_LIDAR)


COMMANDS = (start, pause, finish, discard, live, demo)


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
        told = f"another demonstration is writing to {folder}: wait for it, or give another folder with --out"
        raise ProgramError(Exit.NOT_DONE, told) from None
    finally:
        os.close(descriptor)
