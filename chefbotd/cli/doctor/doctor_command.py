"""The command doctor of chefbotctl."""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING

import click

from chefbotd.cli.common.arguments import Address, configuration
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError

if TYPE_CHECKING:
    from chefbotd.cli.doctor.configuration import RunningDaemon
    from chefbotd.cli.doctor.own_log import LogKept
    from chefbotd.cli.doctor.visit import Visit
    from chefbotd.client import Client
    from chefbotd.settings import Settings

LISTEN_S = click.FloatRange(1.0, 600.0)


@click.command()
@click.option(
    "--config",
    "path",
    metavar="FILE|ROBOT",
    type=configuration,
    help="The robot's; the running daemon's by default.",
)
@click.option("--port", "device", metavar="DEV", help="The board's device, instead of the configured one.")
@click.option("--motors", is_flag=True, help="Drive the wheels too, on blocks, once you have typed yes.")
@click.option(
    "--non-interactive", "--yes", "-y", "quiet", is_flag=True, help="Ask nothing; skip what needs an answer."
)
@click.option(
    "--seconds", type=LISTEN_S, default=5.0, show_default=True, help="For how long the robot is listened to."
)
@click.option(
    "--bundle",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE.tar.gz",
    help="Write what a helper needs to see into an archive, without secrets.",
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
    from chefbotd.cli.doctor import view
    from chefbotd.cli.doctor.own_log import keep_log

    context: CommandContext = ctx.obj
    if bundle is not None and bundle.exists():
        raise ProgramError(Exit.FAILED, f"{bundle}: already there, and not overwritten")
    settings, told = asyncio.run(_settings(path, device, context.address))
    visit = _visit(settings, context.as_json, quiet=quiet)
    visit.seconds, visit.motors = seconds, motors
    context.run(_walk_and_bundle(visit, context, told, bundle, keep_log()))
    if context.as_json:
        echo(view.as_json(visit.findings))
    else:
        echo(f"\n{view.summary(visit.findings)}.")
        if bundle is not None:
            echo(f"Wrote {bundle}: look through it before you send it.")
    ctx.exit(view.exit_code(visit.findings))


def _visit(settings: "Settings", as_json: bool, *, quiet: bool) -> "Visit":
    from chefbotd.cli.doctor import view
    from chefbotd.cli.doctor.asking import Nobody, TerminalAsker
    from chefbotd.cli.doctor.visit import Visit
    from chefbotd.clock import SystemClock
    from chefbotd.link.port import open_port

    asker = Nobody() if quiet else TerminalAsker()
    return Visit(settings, asker, (lambda finding: None) if as_json else view.show, open_port, SystemClock())


async def _settings(path: Path | None, device: str | None, where: Address) -> tuple["Settings", str]:
    """The settings, and where they are from, for people."""
    from chefbotd.cli.doctor import host
    from chefbotd.cli.doctor.configuration import config_of_unit
    from chefbotd.cli.programs.load import load_valid

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
    from chefbotd.cli.doctor.configuration import running_daemons
    from chefbotd.cli.programs.load import load_valid
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
    visit: "Visit", context: CommandContext, told: str, bundle: Path | None, log: "LogKept"
) -> None:
    from chefbotd.cli.doctor.walk import walk

    try:
        await walk(visit, context, told)
    finally:
        if bundle is not None:
            await _write_bundle(visit, context, bundle, log)


async def _write_bundle(visit: "Visit", context: CommandContext, bundle: Path, kept: "LogKept") -> None:
    from chefbotd.cli.doctor import host, view
    from chefbotd.cli.doctor.bundle import LOG_LINES, Redactor, contents, secrets_in, write_bundle

    api = visit.settings.api
    try:
        stats, state = await context.with_client(_figures)
    except ProgramError as failure:
        stats, state = {"not_asked": str(failure)}, {"not_asked": str(failure)}
    log = await host.command_output("journalctl", "--unit=chefbotd", f"--lines={LOG_LINES}", "--no-pager")
    files = contents(
        view.as_data(visit.findings), visit.settings.model_dump(mode="json", by_alias=True), stats, state, log
    )
    files["doctor.txt"] = kept.text()
    secrets = [context.credentials.token or "", *secrets_in(api.token_file, api.tls_key)]
    write_bundle(bundle, files, Redactor(secrets))


async def _figures(robot: "Client") -> tuple[object, object]:
    return await robot.call("get_stats"), await robot.call("get_state")
