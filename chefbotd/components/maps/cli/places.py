"""The commands ``chefbotctl places``: list, save and delete the named places of a map."""

import math

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import NUMBERS_MAY_BE_NEGATIVE, finite
from chefbotd.cli.common.context import CommandContext
from chefbotd.components.maps.cli.asking import ask
from chefbotd.components.maps.cli.drawing import OF_MAP


@click.group()
def places() -> None:
    """List, save and delete the named places of a map."""


@places.command("list")
@OF_MAP
@click.pass_obj
def list_command(context: CommandContext, of_map: str | None) -> None:
    """List the places of a map."""
    listed = ask(context, lambda robot: robot.list_places(of_map))
    rows = [
        [place.name, f"{place.x_m:.2f}", f"{place.y_m:.2f}", f"{math.degrees(place.heading_rad):.0f}°"]
        for place in listed.places
    ]
    headings = [f"place in {listed.map}", "x (m)", "y (m)", "heading"]
    output.table(context.as_json, listed, headings, rows)


@places.command(context_settings=NUMBERS_MAY_BE_NEGATIVE)
@click.argument("name")
@click.argument("x_m", metavar="[X", type=finite, required=False)
@click.argument("y_m", metavar="Y", type=finite, required=False)
@click.argument("heading_deg", metavar="[DEG]]", type=finite, required=False)
@OF_MAP
@click.pass_obj
def save(
    context: CommandContext,
    name: str,
    x_m: float | None,
    y_m: float | None,
    heading_deg: float | None,
    of_map: str | None,
) -> None:
    """Call a pose NAME: the given one, or where the robot is.

    X and Y are in metres of the map, DEG is the heading in degrees, counter-clockwise.
    """
    if x_m is not None and y_m is None:
        raise click.UsageError("X needs a Y with it")
    heading_rad = None if heading_deg is None else math.radians(heading_deg)
    place = ask(context, lambda robot: robot.save_place(name, x_m, y_m, heading_rad, of_map=of_map))
    where = f"({place.x_m:.2f} m, {place.y_m:.2f} m, {math.degrees(place.heading_rad):.0f}°)"
    output.say(context.as_json, place, f"{place.name} is at {where}.")


@places.command()
@click.argument("name")
@OF_MAP
@click.pass_obj
def delete(context: CommandContext, name: str, of_map: str | None) -> None:
    """Delete the place NAME."""
    ask(context, lambda robot: robot.delete_place(name, of_map))
    output.say(context.as_json, {"ok": True}, f"The place {name} is deleted.")
