"""``chefbot-vda5050``: a robot in a fleet (``run``), and how well any robot keeps to the standard (``check``)."""

import asyncio
import contextlib
import signal
import ssl
from collections.abc import Coroutine
from functools import partial
from pathlib import Path
from typing import Any

import click

from chefbot_vda5050 import versions
from chefbot_vda5050.topics import RobotName
from chefbotd.cli.common.arguments import Address, address
from chefbotd.client.access import CA_HELP, CLEAR_TOKEN_HELP

PATH = click.Path(exists=True, dir_okay=False, path_type=Path)


def address_or(text: str, port: int) -> Address:
    """As ``address``; without a port it is this one."""
    has_port = ":" in text.rpartition("]")[2]
    return address(text if has_port else f"{text}:{port}")


@click.group(context_settings={"auto_envvar_prefix": "CHEFBOT_VDA5050"})
def main() -> None:
    """VDA 5050: a fleet's interface to its robots, over MQTT."""


def broker_options(
    command: Any, interface: str | None = versions.V2.interface, major: str | None = versions.V2.major
) -> Any:
    """How a broker is found and spoken to; without ``interface`` and ``major`` they are those of the version."""
    levels = (interface, major) if interface and major else ("uagv, of 3.0 vda5050", "v2, of 3.0 v3")
    for option in reversed(
        (
            click.argument("broker", metavar="BROKER[:PORT]"),
            click.option(
                "--interface", default=interface, help=f"first level of all topics  [default: {levels[0]}]"
            ),
            click.option(
                "--major", default=major, help=f"second level of all topics  [default: {levels[1]}]"
            ),
            click.option("--user", help="for the broker"),
            click.option("--password-file", type=PATH, help="a file with the password"),
            click.option("--tls/--no-tls", default=False, help="encrypted, by the system's authorities"),
            click.option("--cafile", type=PATH, help="encrypted, by this authority"),
            click.option("--certificate", type=PATH, help="to show to the broker, with its key"),
        )
    ):
        command = option(command)
    return command


def robot_options(command: Any) -> Any:
    """Which robot is meant, where, and what it speaks."""
    command = click.option("--manufacturer", default="chefbot", show_default=True)(command)
    command = click.option(
        "--version",
        type=click.Choice(versions.NUMBERS),
        default=versions.V2.number,
        show_default=True,
        help="what the messages say; some masters of 2.0 read no other",
    )(command)
    return broker_options(click.argument("serial")(command), interface=None, major=None)


def broker_of(options: dict[str, Any]) -> Any:
    """The parameters of the connection."""
    from chefbot_vda5050.broker import BrokerParameters

    context = None
    if options["tls"] or options["cafile"] or options["certificate"]:
        context = ssl.create_default_context(cafile=options["cafile"])
        if options["certificate"]:
            context.load_cert_chain(options["certificate"])
    where = address_or(options["broker"], 1883 if context is None else 8883)
    password = options["password_file"].read_text().strip() if options["password_file"] else None
    return BrokerParameters(where.host, where.port, options["user"], password, context)


def name_of(options: dict[str, Any]) -> RobotName:
    """Whose topics they are."""
    try:
        usual = versions.of(options["version"])
        interface, major = options["interface"] or usual.interface, options["major"] or usual.major
        return RobotName(options["manufacturer"], options["serial"], interface, major)
    except ValueError as error:
        raise click.UsageError(str(error)) from error


@main.command()
@robot_options
@click.option("--daemon", default="127.0.0.1:7333", show_default=True, help="the robot's command socket")
@click.option("--token-file", type=PATH, help="a file with a token of the role agent")
@click.option("--ca", type=PATH, help=CA_HELP)
@click.option("--clear-token", is_flag=True, help=CLEAR_TOKEN_HELP)
@click.option("--robot-config", type=PATH, help="the robot's TOML file, for its factsheet and its limits")
@click.option("--carries-kg", type=float, default=0.0, help="for the factsheet")
@click.option("--order-max-age-s", type=float, default=10.0, show_default=True, help="0: any age will do")
@click.option("--visualization-s", type=float, default=1.0, show_default=True, help="0: none")
def run(
    daemon: str,
    token_file: Path | None,
    ca: Path | None,
    robot_config: Path | None,
    carries_kg: float,
    order_max_age_s: float,
    visualization_s: float,
    *,
    clear_token: bool,
    **options: Any,
) -> None:
    """Put the robot of a chefbotd into the fleet on BROKER, as SERIAL."""
    from chefbot_vda5050.service import Parameters, serve
    from chefbotd.client.access import daemon_access
    from chefbotd.settings import load

    where = address_or(daemon, 7333)
    try:
        access = daemon_access(where.host, where.port, token_file, ca, clear_token=clear_token)
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    parameters = Parameters(
        name_of(options),
        broker_of(options),
        settings=load(robot_config) if robot_config else None,
        carries_kg=carries_kg,
        order_max_age_s=order_max_age_s,
        visualization_s=visualization_s,
        version=options["version"],
    )
    connect = partial(access.connect, "fleet")
    with contextlib.suppress(KeyboardInterrupt, asyncio.CancelledError):
        asyncio.run(_until_told(serve(parameters, connect)))
    click.echo("The robot has left the fleet.")


async def _until_told(work: Coroutine[Any, Any, None]) -> None:
    """Work until SIGINT or SIGTERM, and leave the fleet in an orderly way."""
    task = asyncio.ensure_future(work)
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    await task


@main.command()
@robot_options
@click.option(
    "--move", "metres", type=click.FloatRange(0.4, 10.0), help="let it drive so far forwards and back"
)
@click.option("--patience-s", type=float, default=5.0, show_default=True, help="for each answer")
def check(metres: float | None, patience_s: float, **options: Any) -> None:
    """Try whether the robot SERIAL on BROKER keeps to VDA 5050; any maker's. It stands still without --move."""
    from chefbot_vda5050.conformance.cases import Result, run_all
    from chefbot_vda5050.conformance.session import session

    async def try_all() -> list[Result]:
        async with session(broker_of(options), name_of(options), patience_s, options["version"]) as now:
            return await run_all(now, metres)

    results = asyncio.run(try_all())
    for result in results:
        section = result.case.section(options["version"])
        line = f"{result.outcome:<10}{section:<9}{result.case.title}"
        click.echo(f"{line}: {result.text}" if result.text else line)
    counts = [sum(one.outcome == outcome for one in results) for outcome in ("passed", "failed", "not tried")]
    click.echo("{} passed, {} failed, {} not tried".format(*counts))
    if counts[1]:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
