"""The commands ``chefbotctl map edit``: erase, draw, crop, straighten, and take each back."""

import math
from typing import Any, Literal

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import NUMBERS_MAY_BE_NEGATIVE, finite
from chefbotd.cli.common.context import CommandContext
from chefbotd.components.maps.cli.drawing import ID, OF_MAP, POINTS, WIDTH, pair_points, say_saved, spans_of

YES = click.option("--yes", is_flag=True, help="Also where the robot or a place is left with no way.")
ABSENT = "this daemon keeps no maps"


@click.group()
def edit() -> None:
    """Erase a part of a map, draw a wall, crop or straighten it; nothing of the map itself is lost."""


@edit.command("list")
@OF_MAP
@click.pass_obj
def list_command(context: CommandContext, of_map: str | None) -> None:
    """List the edits of a map, in the order in which they are drawn."""
    listed = context.run_with_client(lambda robot: robot.list_map_edits(of_map), absent=ABSENT)
    rows = [
        [
            one.id,
            _kind(one),
            *spans_of(one.points_m),
        ]
        for one in listed.edits
    ]
    output.table(context.as_json, listed, [f"edit of {listed.map}", "kind", "x (m)", "y (m)"], rows)


def _kind(one: Any) -> str:
    if one.kind == "wall":
        return f"wall of {one.width_m:g} m"
    return one.kind if one.to is None else f"erased to {one.to}"


@edit.command(context_settings=NUMBERS_MAY_BE_NEGATIVE)
@POINTS
@click.option("--unknown", is_flag=True, help="What is there becomes unknown; default: free.")
@YES
@OF_MAP
@click.pass_obj
def erase(
    context: CommandContext, numbers: tuple[float, ...], unknown: bool, yes: bool, of_map: str | None
) -> None:
    """Erase what is within these corners, in metres of the map; localization does not expect it any more."""
    _draw(context, "erase", numbers, to="unknown" if unknown else None, confirmed=yes, of_map=of_map)


@edit.command(context_settings=NUMBERS_MAY_BE_NEGATIVE)
@POINTS
@WIDTH
@YES
@OF_MAP
@click.pass_obj
def wall(
    context: CommandContext,
    numbers: tuple[float, ...],
    width_m: float | None,
    yes: bool,
    of_map: str | None,
) -> None:
    """Draw a wall along these points, in metres of the map; nobody drives there."""
    _draw(context, "wall", numbers, width_m=width_m, confirmed=yes, of_map=of_map)


@edit.command(context_settings=NUMBERS_MAY_BE_NEGATIVE)
@POINTS
@YES
@OF_MAP
@click.pass_obj
def crop(context: CommandContext, numbers: tuple[float, ...], yes: bool, of_map: str | None) -> None:
    """Crop the map to what is within these corners, in metres of the map; nobody drives outside."""
    _draw(context, "crop", numbers, confirmed=yes, of_map=of_map)


def _draw(
    context: CommandContext,
    kind: Literal["erase", "wall", "crop"],
    numbers: tuple[float, ...],
    *,
    to: Literal["free", "unknown"] | None = None,
    width_m: float | None = None,
    confirmed: bool,
    of_map: str | None,
) -> None:
    points = pair_points(numbers)
    saved = context.run_with_client(
        lambda robot: robot.edit_map(
            kind, points, to=to, width_m=width_m, confirmed=confirmed, of_map=of_map
        ),
        absent=ABSENT,
    )
    own = "" if saved.edit is None else saved.edit.id
    say_saved(context, saved, f"The map {saved.map} is edited; the edit's id is {own}.")


@edit.command(context_settings=NUMBERS_MAY_BE_NEGATIVE)
@click.argument("degrees", type=finite)
@OF_MAP
@click.pass_obj
def view(context: CommandContext, degrees: float, of_map: str | None) -> None:
    """Show the map turned by DEGREES, counter-clockwise; nothing that is driven by turns."""
    angle_rad = math.remainder(math.radians(degrees), math.tau)
    saved = context.run_with_client(
        lambda robot: robot.turn_map_view(angle_rad, of_map=of_map), absent=ABSENT
    )
    say_saved(context, saved, f"The map {saved.map} is shown turned by {degrees:g} degrees.")


@edit.command()
@ID
@YES
@OF_MAP
@click.pass_obj
def delete(context: CommandContext, id_: str, yes: bool, of_map: str | None) -> None:
    """Take the edit ID off the map, whatever was drawn after it."""
    saved = context.run_with_client(
        lambda robot: robot.delete_map_edit(id_, confirmed=yes, of_map=of_map), absent=ABSENT
    )
    say_saved(context, saved, f"The edit {id_} is deleted.")


@edit.command()
@YES
@OF_MAP
@click.pass_obj
def undo(context: CommandContext, yes: bool, of_map: str | None) -> None:
    """Take the last change back, and then those before it."""
    saved = context.run_with_client(
        lambda robot: robot.undo_map_edit(confirmed=yes, of_map=of_map), absent=ABSENT
    )
    say_saved(context, saved, f"The map {saved.map} is as before its last change.")


@edit.command()
@YES
@OF_MAP
@click.pass_obj
def redo(context: CommandContext, yes: bool, of_map: str | None) -> None:
    """Make the change again that was taken back last."""
    saved = context.run_with_client(
        lambda robot: robot.redo_map_edit(confirmed=yes, of_map=of_map), absent=ABSENT
    )
    say_saved(context, saved, f"The map {saved.map} is changed again.")
