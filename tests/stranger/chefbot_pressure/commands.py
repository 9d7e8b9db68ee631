"""Its command of chefbotctl, and its row of the status."""

from collections.abc import Mapping
from typing import Any

import click

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.state_text import Fact


@click.command()
@click.pass_obj
def pressure(context: CommandContext) -> None:
    """Count the rises of the air pressure from zero again, and print how many there were."""
    answer = context.run_with_client(lambda robot: robot.call("reset_pressure"))
    echo(f"{answer['rises']} rises")


def fact(data: Mapping[str, Any]) -> Fact:
    """The pressure, and how often it has risen."""
    return Fact("pressure", f"{data['pressure_hpa']:.1f} hPa, {data['rises']} rises")
