"""What commands that draw on a map share: options, the points that they are given, and what they say at the end."""

from collections.abc import Sequence
from typing import Any

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import finite
from chefbotd.cli.common.context import CommandContext

OF_MAP = click.option("--map", "of_map", help="Which map; default: the one in use.")
ID = click.argument("id_", metavar="ID")
POINTS = click.argument("numbers", metavar="X Y [X Y]...", type=finite, nargs=-1, required=True)
WIDTH = click.option("--width", "width_m", type=click.FloatRange(0, 5, min_open=True), metavar="M",
                     help="How wide the wall is; default: 0.05.")  # fmt: skip


def pair_points(numbers: Sequence[float]) -> tuple[tuple[float, float], ...]:
    """The points of which these are the coordinates; raises ``click.UsageError`` where one has no Y."""
    if len(numbers) % 2:
        raise click.UsageError(f"expected an X and a Y for each corner, got {len(numbers)} numbers")
    return tuple(zip(numbers[::2], numbers[1::2], strict=True))


def spans_of(points_m: Sequence[Sequence[float]]) -> list[str]:
    """From where to where an outline reaches in x and in y, for a table."""
    return [f"{min(values_m):.2f}…{max(values_m):.2f}" for values_m in zip(*points_m, strict=True)]


def say_saved(context: CommandContext, saved: Any, text: str, notes: str = "") -> None:
    """Say what was saved, and why it is not used where it is not."""
    warned = text if saved.warning is None else f"{text} But {saved.warning}."
    output.say(context.as_json, saved, warned + notes)
