"""The commands ``chefbotctl map``, for the maps that the daemon keeps."""

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.common.extras import require
from chefbotd.cli.maps.asking import ask, progress_bar, write_file
from chefbotd.cli.maps.making import COMMANDS as MAKING
from chefbotd.client import Client

if TYPE_CHECKING:
    from chefbotd.cli.maps.draw import Mark
    from chefbotd.client.map_methods import MapImage
    from chefbotd.client.models import MapSummary

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
    output.table(context.as_json, maps.model_dump(mode="json"), header, [_row(each) for each in maps.maps])


def _row(each: "MapSummary") -> list[str]:
    notes = ["in use" if each.in_use else "", "" if each.condition == "whole" else each.condition]
    notes += ["mapping can go on" if each.can_go_on else "", each.problem or ""]
    told = ", ".join(note for note in notes if note)
    if each.resolution_m is None or each.columns is None or each.rows is None or each.saved_at_s is None:
        return [each.name, "", "", "", told]
    size = f"{each.columns * each.resolution_m:.1f} x {each.rows * each.resolution_m:.1f} m"
    saved = datetime.fromtimestamp(each.saved_at_s).strftime("%Y-%m-%d %H:%M")
    return [each.name, size, saved, str(each.version), told]


@map_group.command()
@click.argument("name")
@click.pass_obj
def load(context: CommandContext, name: str) -> None:
    """Use the map NAME from now on, and after a restart."""
    with progress_bar(f"loading {name}", quiet=context.as_json) as report:
        loaded = ask(context, lambda robot: robot.load_map(name, report))
    warning = f" Beware: {loaded.warning}." if loaded.warning else ""
    text = f"The map {loaded.name} (version {loaded.version}) is in use.{warning}"
    output.say(context.as_json, loaded.model_dump(), text)


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
    text = f"Stored as the map {stored.name}, version {stored.version}. 'chefbotctl map load' uses it."
    output.say(context.as_json, stored.model_dump(), text)


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
    facts = {key: getattr(image, key) for key in image.__dataclass_fields__ if key != "cells"}
    if png is not None:
        from chefbotd.cli.maps.png import to_png

        write_file(png, to_png(image.grid(), marks), force=force)
        output.say(context.as_json, {**facts, "png": str(png)}, f"Wrote {png}.")
        return
    if context.as_json:
        output.say(True, facts, "")
        return
    _draw(image, marks)


def _draw(image: "MapImage", marks: "list[Mark]") -> None:
    from chefbotd.cli.common.console import Printer
    from chefbotd.cli.common.echo import writing
    from chefbotd.cli.maps.draw import draw_map

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


def _fetch(context: CommandContext, name: str | None) -> "tuple[MapImage, list[Mark]]":
    """A map, and what is to be marked in it."""

    async def fetch(robot: Client) -> "tuple[MapImage, list[Mark]]":
        image = await robot.get_map(name, report)
        is_made = image.saved_at_s is None
        places = () if image.name is None else (await robot.list_places(image.name)).places
        return image, [*_place_marks(places), *await _robot_mark(robot, None if is_made else image.name)]

    with progress_bar("receiving the map", quiet=context.as_json) as report:
        return ask(context, fetch)


def _place_marks(places: Any) -> "list[Mark]":
    from chefbotd.cli.maps.draw import Mark

    return [Mark(place.x_m, place.y_m, label=place.name) for place in places]


async def _robot_mark(robot: Client, name: str | None) -> "list[Mark]":
    """The robot, where something localizes it in this map; None is the map that is being made."""
    from chefbotd.cli.maps.draw import Mark

    topics = (await robot.call("get_state"))["topics"]
    told = topics.get("map_pose")
    is_making = "mapping" in topics and topics["mapping"]["data"]["state"] != "idle"
    its_map = None if is_making else (await robot.list_maps()).in_use
    if told is None or told["age_s"] > MOST_AGE_S or its_map != name:
        return []
    pose = told["data"]
    return [Mark(pose["x_m"], pose["y_m"], pose["heading_rad"], style="bold red")]


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
    from chefbotd.mapping.map_server import Mode, to_description, to_image
    from chefbotd.maps.errors import MapStoreError
    from chefbotd.maps.names import map_name

    if mode == Mode.SCALE:
        require("maps", "PIL")
    with progress_bar("receiving the map", quiet=context.as_json) as report:
        image = ask(context, lambda robot: robot.get_map(name, report))
    try:
        stem = map_name(image.name or "new map")
    except MapStoreError as error:
        raise ProgramError(Exit.FAILED, f"the daemon's map: {error}") from error
    grid, suffix = image.grid(), ".png" if mode == Mode.SCALE else ".pgm"
    description = to_description(grid, f"{stem}{suffix}", Mode(mode)).encode()
    write_file(folder / f"{stem}{suffix}", to_image(grid, Mode(mode)), force=force)
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
@click.option("--yes", is_flag=True, help="Do not ask.")
@click.pass_obj
def delete(context: CommandContext, name: str, yes: bool) -> None:
    """Delete the map NAME with all its versions and places."""
    if not (yes or context.as_json):
        click.confirm(f"Delete the map {name} with all its versions and places?", abort=True, err=True)
    ask(context, lambda robot: robot.delete_map(name))
    output.say(context.as_json, {"ok": True}, f"The map {name} is deleted.")


for command in MAKING:
    map_group.add_command(command)
