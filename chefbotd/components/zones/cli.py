"""The commands ``chefbotctl zones``: list, draw, switch and delete the zones of a map."""

from pathlib import Path
from typing import Any

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import NUMBERS_MAY_BE_NEGATIVE, finite
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.exits import Exit, ProgramError, require
from chefbotd.client import Client
from chefbotd.components.maps.cli.drawing import ID, OF_MAP, POINTS, WIDTH, pair_points, say_saved, spans_of

YES = click.option("--yes", is_flag=True, help="Also where it covers the robot or a place, or cuts one off.")
ABSENT = "this daemon keeps no zones: its robot makes no maps"


@click.group()
def zones() -> None:
    """List, draw and delete zones of a map: where not to go, and where to go slowly."""


@zones.command("list")
@OF_MAP
@click.pass_obj
def list_command(context: CommandContext, of_map: str | None) -> None:
    """List the zones of a map."""
    listed = context.run_with_client(lambda robot: robot.list_zones(of_map), absent=ABSENT)
    rows = [
        [
            zone.id,
            _kind(zone),
            zone.name,
            *spans_of(zone.points_m),
            "yes" if zone.enabled else "no",
        ]
        for zone in listed.zones
    ]
    headings = [f"zone of {listed.map}", "kind", "name", "x (m)", "y (m)", "counts"]
    output.table(context.as_json, listed, headings, rows)


def _kind(zone: Any) -> str:
    return f"{zone.max_speed_m_s:g} m/s" if zone.kind == "slow" else zone.kind.replace("_", " ")


@zones.command(context_settings=NUMBERS_MAY_BE_NEGATIVE)
@click.argument("name")
@POINTS
@click.option("--slow", "max_speed_m_s", type=click.FloatRange(0, 10, min_open=True), metavar="M_S",
              help="A slow zone: no faster than this in it.")  # fmt: skip
@click.option("--wall", is_flag=True, help="A wall along these points.")
@WIDTH
@YES
@OF_MAP
@click.pass_obj
def add(
    context: CommandContext,
    name: str,
    numbers: tuple[float, ...],
    max_speed_m_s: float | None,
    wall: bool,
    width_m: float | None,
    yes: bool,
    of_map: str | None,
) -> None:
    """Draw a zone NAME with these corners, in metres of the map; not to be entered, if nothing else is said."""
    points = pair_points(numbers)
    if wall and max_speed_m_s is not None:
        raise click.UsageError("a wall has no speed: --wall or --slow, not both")
    kind: Any = "wall" if wall else "keep_out" if max_speed_m_s is None else "slow"
    saved = context.run_with_client(
        lambda robot: robot.save_zone(
            points,
            kind=kind,
            name=name,
            max_speed_m_s=max_speed_m_s,
            width_m=width_m,
            confirmed=yes,
            of_map=of_map,
        ),
        absent=ABSENT,
    )
    own = "" if saved.zone is None else saved.zone.id
    say_saved(context, saved, f"The zone {name} is drawn; its id is {own}.")


@zones.command("import", context_settings=NUMBERS_MAY_BE_NEGATIVE)
@click.argument("mask", metavar="MASK.yaml", type=click.Path(path_type=Path, dir_okay=False))
@click.option("--kind", type=click.Choice(("keepout", "speed")), required=True, help="Of the filter.")
@click.option("--base", type=finite, default=0.0, show_default=True, help="Of its CostmapFilterInfo.")
@click.option("--multiplier", type=finite, default=1.0, show_default=True, help="Of its CostmapFilterInfo.")
@click.option("--percent-of", "percent_of_m_s", type=click.FloatRange(0, 10, min_open=True), metavar="M_S",
              help="Type 1: speeds are percentages of this one; default: type 2, m/s.")  # fmt: skip
@YES
@OF_MAP
@click.pass_obj
def import_command(
    context: CommandContext,
    mask: Path,
    kind: str,
    base: float,
    multiplier: float,
    percent_of_m_s: float | None,
    yes: bool,
    of_map: str | None,
) -> None:
    """Draw the mask of a Nav2 costmap filter, which is on this computer, as zones; 'undo' takes them back."""
    require("maps", "PIL")
    from chefbotd.components.maps.storage.disk import MapStoreError
    from chefbotd.components.zones.nav2_mask import FilterInfo, MaskError, read_mask

    try:
        read = read_mask(mask, kind, FilterInfo(base, multiplier, percent_of_m_s))
    except (MaskError, MapStoreError) as error:
        raise ProgramError(Exit.FAILED, str(error)) from error
    saved = context.run_with_client(
        lambda robot: robot.add_zones(read.zones, confirmed=yes, of_map=of_map), absent=ABSENT
    )
    notes = "".join(f" Note: {note}." for note in read.notes)
    count = f"{len(read.zones)} {'zone' if len(read.zones) == 1 else 'zones'}"
    text = f"{count} of {mask.name} drawn on the map {saved.map}."
    say_saved(context, saved, text, notes)


@zones.command()
@ID
@OF_MAP
@click.pass_obj
def delete(context: CommandContext, id_: str, of_map: str | None) -> None:
    """Delete the zone ID."""
    saved = context.run_with_client(lambda robot: robot.delete_zone(id_, of_map=of_map), absent=ABSENT)
    say_saved(context, saved, f"The zone {id_} is deleted.")


@zones.command()
@ID
@YES
@OF_MAP
@click.pass_obj
def on(context: CommandContext, id_: str, yes: bool, of_map: str | None) -> None:
    """Have the zone ID count."""
    saved = context.run_with_client(lambda robot: _switch(robot, id_, True, yes, of_map), absent=ABSENT)
    say_saved(context, saved, f"The zone {id_} counts.")


@zones.command()
@ID
@OF_MAP
@click.pass_obj
def off(context: CommandContext, id_: str, of_map: str | None) -> None:
    """Keep the zone ID, and have it not count."""
    saved = context.run_with_client(lambda robot: _switch(robot, id_, False, False, of_map), absent=ABSENT)
    say_saved(context, saved, f"The zone {id_} does not count.")


async def _switch(robot: Client, id_: str, enabled: bool, confirmed: bool, of_map: str | None) -> Any:
    """Save a zone as it is, but for this."""
    listed = await robot.list_zones(of_map)
    zone = next((zone for zone in listed.zones if zone.id == id_), None)
    return await robot.save_zone(
        ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)) if zone is None else zone.points_m,
        id=id_,
        kind="keep_out" if zone is None else zone.kind,
        name="" if zone is None else zone.name,
        enabled=enabled,
        max_speed_m_s=None if zone is None else zone.max_speed_m_s,
        width_m=None if zone is None else zone.width_m,
        revision=listed.revision,
        confirmed=confirmed,
        of_map=listed.map,
    )


@zones.command()
@OF_MAP
@click.pass_obj
def undo(context: CommandContext, of_map: str | None) -> None:
    """Take the last change back; done again, it is made again."""
    saved = context.run_with_client(lambda robot: robot.undo_zones(of_map=of_map), absent=ABSENT)
    say_saved(context, saved, f"The zones of {saved.map} are as before.")
