"""The commands ``chefbotctl map``, for the maps that the daemon keeps, and for the one that is being made."""

import math
from collections.abc import Awaitable, Callable
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.add_on import ros2_add_on
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo, tell
from chefbotd.cli.common.exits import Exit, ProgramError, require
from chefbotd.cli.programs.program import example
from chefbotd.client import Client
from chefbotd.components.maps.cli.asking import ask, progress_bar, write_file
from chefbotd.core.geometry import Pose2D

if TYPE_CHECKING:
    from chefbotd.client.models import MapSummary
    from chefbotd.components.maps.cli.draw import MapMark
    from chefbotd.components.maps.map_image import MapImage


T = TypeVar("T")

NEEDS_LIDAR = "this robot makes no maps: its configuration has no [[lidar]], or [worker] enabled = false"

LEGEND_ROWS, MOST_AGE_S = 3, 2.0
MODES = ("trinary", "scale", "raw")


@click.group("map")
def map_group() -> None:
    """Make, show, load, import and export maps."""


@map_group.command("list")
@click.pass_obj
def list_command(context: CommandContext) -> None:
    """List the maps that the robot keeps."""
    maps = ask(context, lambda robot: robot.list_maps())
    if not maps.maps and not context.as_json:
        echo(f"There is no map in {maps.folder} yet.")
        return
    header = ["map", "size", "saved", "version", ""]
    output.table(context.as_json, maps, header, [_row(summary) for summary in maps.maps])


def _row(summary: "MapSummary") -> list[str]:
    notes = ["in use" if summary.in_use else "", "" if summary.condition == "whole" else summary.condition]
    notes += ["mapping can go on" if summary.can_go_on else "", summary.problem or ""]
    notes_text = ", ".join(note for note in notes if note)
    if (
        summary.resolution_m is None
        or summary.columns is None
        or summary.rows is None
        or summary.saved_at_s is None
    ):
        return [summary.name, "", "", "", notes_text]
    size = f"{summary.columns * summary.resolution_m:.1f} x {summary.rows * summary.resolution_m:.1f} m"
    saved = datetime.fromtimestamp(summary.saved_at_s).strftime("%Y-%m-%d %H:%M")
    return [summary.name, size, saved, str(summary.version), notes_text]


@map_group.command()
@click.argument("name")
@click.option(
    "--resolution-is-right", is_flag=True, help="Its cells, or its size, are as large as they seem."
)
@click.pass_obj
def load(context: CommandContext, name: str, resolution_is_right: bool) -> None:
    """Use the map NAME from now on, and after a restart."""
    with progress_bar(f"loading {name}", quiet=context.as_json) as report:
        loaded = ask(
            context,
            lambda robot: robot.load_map(name, resolution_is_right=resolution_is_right, on_progress=report),
        )
    warning = f" Beware: {loaded.warning}." if loaded.warning else ""
    text = f"The map {loaded.name} (version {loaded.version}) is in use.{warning}"
    output.say(context.as_json, loaded, text)


@map_group.command("import")
@click.argument("yaml", metavar="FILE.yaml")
@click.option("--name", help="The map's name; default: the file's.")
@click.option("--replace", is_flag=True, help="The map may exist: this becomes its next version.")
@click.pass_obj
def import_command(context: CommandContext, yaml: str, name: str | None, replace: bool) -> None:
    """Store the map of map_server's FILE.yaml, which is on the robot's computer."""
    path = Path(yaml)
    where = str(path.resolve()) if path.exists() else yaml
    with progress_bar(f"importing {path.name}", quiet=context.as_json) as report:
        stored = ask(
            context, lambda robot: robot.import_map(where, name, replace=replace, on_progress=report)
        )
    note = f" Beware: {stored.warning}." if stored.warning else ""
    text = f"Stored as the map {stored.name}, version {stored.version}. 'chefbotctl map load' uses it.{note}"
    output.say(context.as_json, stored, text)


@map_group.command()
@click.argument("name", required=False)
@click.option(
    "--png", type=click.Path(path_type=Path, dir_okay=False), help="Write a PNG instead of drawing."
)
@click.option("--force", is_flag=True, help="Replace a PNG that exists.")
@click.pass_obj
def show(context: CommandContext, name: str | None, png: Path | None, force: bool) -> None:
    """Draw the map NAME in the terminal, or the one being made or in use, with its places and the robot."""
    if png is not None:
        require("maps", "PIL")
    image, marks = _fetch(context, name)
    facts = {key: getattr(image, key) for key in image.__struct_fields__ if key != "cells"}
    if png is not None:
        from chefbotd.components.maps.cli.png import to_png

        write_file(png, to_png(image.grid(), marks), force=force)
        output.say(context.as_json, {**facts, "png": str(png)}, f"Wrote {png}.")
        return
    if context.as_json:
        output.say(True, facts, "")
        return
    _draw(image, marks)


def _draw(image: "MapImage", marks: "list[MapMark]") -> None:
    from chefbotd.cli.common.console import Printer
    from chefbotd.cli.common.echo import writing
    from chefbotd.components.maps.cli.draw import draw_map

    console = Printer(highlight=False, soft_wrap=True)
    rows = max(1, console.height - LEGEND_ROWS)
    with writing():
        console.print(draw_map(image.grid(), console.width, rows, marks, color=console.draws_color))
        console.print(_legend(image))


def _legend(image: "MapImage") -> str:
    width_m, height_m = image.columns * image.resolution_m, image.rows * image.resolution_m
    size = f"{width_m:.1f} x {height_m:.1f} m, cells of {image.resolution_m:g} m"
    made = "being made" if image.saved_at_s is None else f"version {image.version}"
    return f"{image.name or 'a new map'}, {made}: {size}"


def _fetch(context: CommandContext, name: str | None) -> "tuple[MapImage, list[MapMark]]":
    """A map, and what is to be marked in it."""

    async def fetch(robot: Client) -> "tuple[MapImage, list[MapMark]]":
        image = await robot.get_map(name, report)
        is_made = image.saved_at_s is None
        places = () if image.name is None else (await robot.list_places(image.name)).places
        return image, [*_place_marks(places), *await _robot_mark(robot, None if is_made else image.name)]

    with progress_bar("receiving the map", quiet=context.as_json) as report:
        return ask(context, fetch)


def _place_marks(places: Any) -> "list[MapMark]":
    from chefbotd.components.maps.cli.draw import MapMark

    return [MapMark(place.x_m, place.y_m, label=place.name) for place in places]


async def _robot_mark(robot: Client, name: str | None) -> "list[MapMark]":
    """The robot, where something localizes it in this map; None is the map that is being made."""
    from chefbotd.components.maps.cli.draw import MapMark

    topics = (await robot.call("get_state"))["topics"]
    latest = topics.get("map_pose")
    is_making = "mapping" in topics and topics["mapping"]["data"]["state"] != "idle"
    its_map = None if is_making else (await robot.list_maps()).in_use
    if (
        latest is None
        or latest["age_s"] > MOST_AGE_S
        or its_map != name
        or latest["data"]["state"] == "ended"
    ):
        return []
    pose = latest["data"]
    return [MapMark(pose["x_m"], pose["y_m"], pose["heading_rad"], style="bold red")]


@map_group.command()
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.option("--map", "name", help="Which map; default: the one in use.")
@click.option(
    "--mode", type=click.Choice(MODES), default="trinary", show_default=True, help="map_server's mode."
)
@click.option("--force", is_flag=True, help="Replace files that exist.")
@click.pass_obj
def export(context: CommandContext, folder: Path, name: str | None, mode: str, force: bool) -> None:
    """Write a map into FOLDER on this computer, as files that ROS's tools read.

    'scale' and 'raw' keep every cell's percentage, 'trinary' free, occupied and unknown.
    """
    from chefbotd.components.maps.algorithms.map_server import ImageMode, to_description, to_image
    from chefbotd.components.maps.storage.disk import MapStoreError
    from chefbotd.components.maps.storage.names import map_name

    if mode == ImageMode.SCALE:
        require("maps", "PIL")
    with progress_bar("receiving the map", quiet=context.as_json) as report:
        image = ask(context, lambda robot: robot.get_map(name, report))
    try:
        stem = map_name(image.name or "new map")
    except MapStoreError as error:
        raise ProgramError(Exit.FAILED, f"the daemon's map: {error}") from error
    grid, suffix = image.grid(), ".png" if mode == ImageMode.SCALE else ".pgm"
    description = to_description(grid, f"{stem}{suffix}", ImageMode(mode)).encode()
    write_file(folder / f"{stem}{suffix}", to_image(grid, ImageMode(mode)), force=force)
    write_file(folder / f"{stem}.yaml", description, force=force)
    files = [str(folder / f"{stem}{end}") for end in (".yaml", suffix)]
    output.say(context.as_json, {"files": files}, f"Wrote {' and '.join(files)}.")


@map_group.command()
@click.argument("name")
@click.argument("new_name", metavar="NEW")
@click.pass_obj
def rename(context: CommandContext, name: str, new_name: str) -> None:
    """Give the map NAME another name."""
    ask(context, lambda robot: robot.rename_map(name, new_name))
    output.say(context.as_json, {"ok": True}, f"The map {name} is now called {new_name}.")


@map_group.command()
@click.argument("name")
@click.argument("new_name", metavar="NEW")
@click.pass_obj
def copy(context: CommandContext, name: str, new_name: str) -> None:
    """Keep a copy of the map NAME to go back to, with its places, zones and edits."""
    copied = ask(context, lambda robot: robot.copy_map(name, new_name))
    output.say(context.as_json, copied, f"The map {name} is kept as {copied.name}, too.")


@map_group.command()
@click.argument("name")
@click.option("--yes", is_flag=True, help="Do not ask.")
@click.pass_obj
def delete(context: CommandContext, name: str, yes: bool) -> None:
    """Delete the map NAME with all its versions and places."""
    if not (yes or context.as_json):
        click.confirm(f"Delete the map {name} with all its versions and places?", abort=True, err=True)
    ask(context, lambda robot: robot.delete_map(name))
    output.say(context.as_json, {"ok": True}, f"The map {name} is deleted.")


@map_group.command("from-bag")
@click.argument("bag", type=click.Path(path_type=Path))
@click.argument("name")
@click.option(
    "--folder", type=click.Path(path_type=Path, file_okay=False), required=True, help="The folder of maps."
)
@click.option("--scans", "topics", multiple=True, metavar="TOPIC", help="Of these scans; default: all.")
@click.option(
    "--mount",
    nargs=3,
    type=float,
    metavar="X Y YAW",
    help="Where the lidar sits, if the bag does not say: metres ahead and to the left, degrees CCW.",
)
@click.option("--upside-down", is_flag=True, help="With --mount: the lidar hangs upside down.")
@click.pass_obj
def from_bag(
    context: CommandContext,
    bag: Path,
    name: str,
    folder: Path,
    topics: tuple[str, ...],
    mount: tuple[float, float, float] | None,
    upside_down: bool,
) -> None:
    """Map the odometry and the scans of a ROS 2 BAG, and store it as NAME; needs the package chefbot-ros2.

    No daemon is asked: FOLDER is [maps] folder of the robot that is to use it.
    """
    require("navigation", "numba", "scipy")
    bags = ros2_add_on("from_bag")
    if upside_down and mount is None:
        raise click.UsageError("--upside-down says how the lidar of --mount hangs, and needs it")
    given = None
    if mount is not None:
        x_m, y_m, yaw_deg = mount
        given = bags.Mount(Pose2D(x_m, y_m, math.radians(yaw_deg)), upside_down)
    try:
        mapped = bags.map_bag(bag, folder, name, topics, given)
    except bags.CannotMapBagError as error:
        raise ProgramError(Exit.FAILED, str(error)) from error
    saved = mapped.saved
    text = f"Saved {saved.name}, version {saved.version}: {saved.keyframes} scans on {saved.path_m:.0f} m."
    output.say(context.as_json, saved, text)
    if mapped.doubt:
        tell(f"Warning: {mapped.doubt}")


@map_group.command()
@click.argument("name", required=False)
@click.option("--unfinished", is_flag=True, help="Go on with the map that was never finished.")
@click.pass_obj
def start(context: CommandContext, name: str | None, unfinished: bool) -> None:
    """Begin a map, or go on with the saved map NAME, or after a pause.

    Drive the robot through the rooms then, by whatever means, and 'chefbotctl map finish NAME'.
    """
    result = _run(context, lambda robot: robot.start_mapping(name, unfinished=unfinished))
    begun = f"Mapping: {result.keyframes} scans so far." if result.keyframes else "Mapping."
    warning = f" Beware: {result.warning}." if result.warning else ""
    output.say(context.as_json, result, f"{begun} 'chefbotctl map live' shows the map.{warning}")


@map_group.command()
@click.pass_obj
def pause(context: CommandContext) -> None:
    """Add nothing to the map until 'map start'."""
    result = _run(context, lambda robot: robot.pause_mapping())
    output.say(context.as_json, result, f"Paused, with {result.keyframes} scans.")


@map_group.command()
@click.argument("name")
@click.pass_obj
def finish(context: CommandContext, name: str) -> None:
    """Match all scans once more, save the map as NAME, and end. Ctrl-C gives up, and mapping goes on."""
    with progress_bar(f"finishing {name}", quiet=context.as_json) as report:
        saved = _run(context, lambda robot: robot.finish_mapping(name, on_progress=report))
    text = f"Saved {saved.name}, version {saved.version}: {saved.keyframes} scans on {saved.path_m:.0f} m."
    output.say(context.as_json, saved, text)


@map_group.command()
@click.option("--yes", is_flag=True, help="Do not ask.")
@click.pass_obj
def discard(context: CommandContext, yes: bool) -> None:
    """Forget the map that is being made, or was never finished. Saved maps stay."""
    if not (yes or context.as_json):
        click.confirm("Forget the map that is being made?", abort=True, err=True)
    result = _run(context, lambda robot: robot.discard_mapping())
    output.say(context.as_json, result, "The map is discarded.")


@map_group.command()
@click.pass_obj
def live(context: CommandContext) -> None:
    """Draw the map that is being made, as it grows, with the robot in it, until Ctrl-C."""
    from chefbotd.components.maps.cli.live_view import LiveMapView, MappingScene, listen

    view = LiveMapView(quiet=context.as_json)

    async def watch(robot: Client) -> None:
        with view.showing() as show:
            await listen(robot, MappingScene(doing="mapping"), show)

    _run(context, watch)


def _run(context: CommandContext, action: Callable[[Client], Awaitable[T]]) -> T:
    return context.run_with_client(action, absent=NEEDS_LIDAR)


map_group.add_command(example("demo", "map"))
