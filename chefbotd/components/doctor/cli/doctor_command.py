"""The commands doctor and ports of chefbotctl."""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING

import click

from chefbotd.cli.common.arguments import Address, configuration
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo, say_sentences, tell
from chefbotd.cli.common.exits import Exit, ProgramError

if TYPE_CHECKING:
    from chefbotd.components.doctor.cli.bundle import LogKept
    from chefbotd.components.doctor.cli.diagnosis import Diagnosis
    from chefbotd.components.doctor.cli.host import RunningDaemon
    from chefbotd.settings import Settings
import json
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING

from chefbotd.cli.common import output

if TYPE_CHECKING:
    from chefbotd.components.doctor.listening.ports import Behind, SerialPort

LISTEN_S = click.FloatRange(1.0, 600.0)


@click.command()
@click.option(
    "--config",
    "path",
    metavar="FILE|ROBOT",
    type=configuration,
    help="The robot's configuration; the running daemon's by default.",
)
@click.option("--port", "device", metavar="DEV", help="The board's device, instead of the configured one.")
@click.option("--motors", is_flag=True, help="Drive the wheels too, on blocks, once you have typed yes.")
@click.option(
    "--non-interactive", "--yes", "-y", "quiet", is_flag=True, help="Ask nothing; skip what needs an answer."
)
@click.option(
    "--seconds", type=LISTEN_S, default=5.0, show_default=True, help="How long to listen to the robot."
)
@click.option(
    "--bundle",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE.tar.gz",
    help="Write a support archive: what a helper needs to see, without secrets.",
)
@click.pass_context
def doctor(
    ctx: click.Context,
    path: Path | None,
    device: str | None,
    motors: bool,
    quiet: bool,
    seconds: float,
    bundle: Path | None,
) -> None:
    """Find out what is wrong with the robot, from its power to its pose.

    Talks to the daemon if one runs; else it opens the board's port itself. Nothing moves unless you have typed yes.
    Exit code 0: all is well or skipped, 8: warnings, 9: problems.
    """
    from chefbotd.components.doctor.cli import view
    from chefbotd.components.doctor.cli.bundle import keep_log

    context: CommandContext = ctx.obj
    if bundle is not None and bundle.exists():
        raise ProgramError(Exit.FAILED, f"{bundle}: already exists, and is not overwritten")
    settings, origin = asyncio.run(_settings(path, device, context.address))
    diagnosis = _diagnosis(settings, context.as_json, quiet=quiet)
    diagnosis.seconds, diagnosis.motors, diagnosis.wanted_device = seconds, motors, device
    context.run(_walk_and_bundle(diagnosis, context, origin, bundle, keep_log()))
    if context.as_json:
        echo(view.as_json(diagnosis.findings))
    else:
        echo(f"\n{view.summary(diagnosis.findings)}.")
        if bundle is not None:
            echo(f"Wrote {bundle}: look through it before you send it.")
    ctx.exit(view.exit_code(diagnosis.findings))


def _diagnosis(settings: "Settings", as_json: bool, *, quiet: bool) -> "Diagnosis":
    from chefbotd.clock import SystemClock
    from chefbotd.components.doctor.cli import view
    from chefbotd.components.doctor.cli.diagnosis import Diagnosis, NoAnswers, TerminalAsker
    from chefbotd.link.port import open_port

    asker = NoAnswers() if quiet else TerminalAsker()
    return Diagnosis(
        settings, asker, (lambda finding: None) if as_json else view.show, open_port, SystemClock()
    )


async def _settings(path: Path | None, device: str | None, where: Address) -> tuple["Settings", str]:
    """The settings, and where they are from, for people."""
    from chefbotd.cli.programs.load import load_valid
    from chefbotd.components.doctor.cli import host
    from chefbotd.components.doctor.cli.host import config_of_unit

    overrides = {} if device is None else {"link.device": device}
    if path is not None:
        return load_valid(path, overrides), str(path)
    if (running := _daemon_at(where)) is not None:
        name = running.config or "chefbot"
        return load_valid(configuration(name), overrides), f"{name}, as the daemon with pid {running.pid}"
    unit = await host.service_unit() or {}
    if name := config_of_unit(unit.get("ExecStart", "")):
        return load_valid(configuration(name), overrides), f"{name}, as the service"
    return load_valid(None, overrides), "the packaged ChefBot's, as --config names none"


def _daemon_at(where: Address) -> "RunningDaemon | None":
    """The daemon on this computer that listens at an address, by its command line and its configuration."""
    from chefbotd.cli.programs.load import load_valid
    from chefbotd.components.doctor.cli.host import running_daemons
    from chefbotd.rpc.parameters import is_loopback

    for running in running_daemons() if is_loopback(where.host) else ():
        port = running.listen.rpartition(":")[2]
        try:
            port = port or str(load_valid(configuration(running.config or "chefbot")).api.port)
        except (ProgramError, click.BadParameter):
            continue  # another user's file, or one that has gone
        if port == str(where.port):
            return running
    return None


async def _walk_and_bundle(
    diagnosis: "Diagnosis", context: CommandContext, origin: str, bundle: Path | None, log: "LogKept"
) -> None:
    from chefbotd.components.doctor.cli.bundle import gather_bundle
    from chefbotd.components.doctor.cli.walk import walk

    try:
        await walk(diagnosis, context, origin)
    finally:
        if bundle is not None:
            await gather_bundle(diagnosis.settings, diagnosis.findings, context, bundle, log.text())


COLUMNS = ("port", "lasting name", "USB", "driver", "open it?", "held by")


@click.command()
@click.argument("devices", metavar="[DEVICE]...", nargs=-1)
@click.option("--listen", "listens", is_flag=True, help="Find out what is behind each: boards and lidars.")
@click.option(
    "--udev", "name", metavar="NAME", help="Print the udev rule by which DEVICE is always /dev/NAME."
)
@click.pass_obj
def ports(context: CommandContext, devices: tuple[str, ...], listens: bool, name: str | None) -> None:
    """Show the serial ports that are plugged in; with DEVICE, these.

    With --listen each free port is opened and listened to at the usual baud rates; some boards restart when their port
    is opened. Nothing is written to a port on which anything is heard. Only where nothing at all is heard for 2.5 s, an
    RPLIDAR is asked what it is: two bytes (A5 50), which no board takes for a command.
    """
    from chefbotd.clock import SystemClock
    from chefbotd.components.doctor.listening.ports import look_behind, serial_ports
    from chefbotd.link.port import open_port

    ports_here = serial_ports(devices)
    if name is not None:
        _print_rule(ports_here, name, context)
        return
    if not context.as_json:
        _show(ports_here, is_search=not devices)
    if listens and not context.as_json and ports_here:
        echo("Listening; this takes up to 10 s a port.")
    behind = context.run(_all(look_behind(ports_here, open_port, SystemClock()), context)) if listens else []
    if context.as_json:
        echo(json.dumps({"ports": [_as_data(port, behind) for port in ports_here]}))


def _print_rule(ports_here: "list[SerialPort]", name: str, context: CommandContext) -> None:
    """The rule for the one port; what to do with it goes beside the rule, which may be piped into its file."""
    from chefbotd.components.doctor.listening.udev import RULES_FILE, udev_rule

    if len(ports_here) != 1:
        named = ", ".join(port.device for port in ports_here) or "none"
        raise click.UsageError(f"--udev names one port; name its DEVICE (plugged in: {named})")
    try:
        rule = udev_rule(ports_here[0], name)
    except ValueError as error:
        raise ProgramError(Exit.NOT_DONE, str(error)) from error
    if context.as_json:
        echo(json.dumps({"rule": rule, "file": RULES_FILE.format(name=name)}))
        return
    tell(f"Into {RULES_FILE.format(name=name)}; then: sudo udevadm control --reload, and plug it in again")
    echo(rule.rstrip())


NOTHING_ON_USB = (
    "No port on USB was found: is the board plugged in (a charging cable has no data lines), and powered? If lsusb "
    "lists it, its driver is missing, or a program for braille displays has taken it (CH340, CP210x: apt remove brltty)."
)


def _show(ports_here: "list[SerialPort]", *, is_search: bool) -> None:
    if is_search and not any(port.usb_id or port.device.startswith("/dev/pts/") for port in ports_here):
        say_sentences(NOTHING_ON_USB)
    if not ports_here:
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
