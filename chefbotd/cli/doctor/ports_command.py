"""The command ports of chefbotctl."""

import json
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo

if TYPE_CHECKING:
    from chefbotd.doctor.listening.ports import Behind, SerialPort

COLUMNS = ("port", "lasting name", "USB", "driver", "open it?", "held by")


@click.command()
@click.argument("devices", metavar="[DEVICE]...", nargs=-1)
@click.option("--listen", "listens", is_flag=True, help="Find out what is behind each: boards and lidars.")
@click.pass_obj
def ports(context: CommandContext, devices: tuple[str, ...], listens: bool) -> None:
    """Show the serial ports that are plugged in; with DEVICE, these.

    With --listen each free port is opened and listened to at the usual baud rates; some boards restart when their port
    is opened. Nothing is written to a port on which anything is heard. Only where nothing at all is heard for 2.5 s, an
    RPLIDAR is asked what it is: two bytes (A5 50), which no board takes for a command.
    """
    from chefbotd.clock import SystemClock
    from chefbotd.doctor.listening.ports import look_behind, serial_ports
    from chefbotd.link.port import open_port

    ports_here = serial_ports(devices)
    if not context.as_json:
        _show(ports_here)
    if listens and not context.as_json and ports_here:
        echo("Listening; this takes up to 10 s a port.")
    behind = context.run(_all(look_behind(ports_here, open_port, SystemClock()), context)) if listens else []
    if context.as_json:
        echo(json.dumps({"ports": [_as_data(port, behind) for port in ports_here]}))


def _show(ports_here: "list[SerialPort]") -> None:
    if not ports_here:
        echo(
            "No serial port was found: is the board plugged in (a charging cable has no data lines), and powered?"
        )
        return
    rows = [
        (
            port.device,
            port.by_id or port.product,
            port.usb_id,
            port.driver,
            f"no: {port.permission}" if port.permission else "yes",
            port.held_by or "nobody",
        )
        for port in ports_here
    ]
    output.table(False, {}, COLUMNS, rows)


async def _all(looking: "AsyncIterator[Behind]", context: CommandContext) -> "list[Behind]":
    """Everything that is found, told as soon as it is."""
    rows = []
    async for row in looking:
        rows.append(row)
        if not context.as_json:
            at = f", {row.baud} baud" if row.baud else ""
            echo(f"{row.device}: {row.told}{at}")
    return rows


def _as_data(port: "SerialPort", behind: "list[Behind]") -> dict[str, object]:
    from msgspec.structs import asdict

    heard = [asdict(row) for row in behind if row.device == port.device]
    return {**asdict(port), **({"behind": heard[0]} if heard else {})}
