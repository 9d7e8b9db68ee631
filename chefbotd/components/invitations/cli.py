"""The commands of chefbotctl that let phones in: invite one, list and revoke."""

import json
import re
from datetime import datetime
from typing import Any

import click

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.components.invitations.qr import terminal_qr

ROLES = {
    "guest": "guest",
    "driver": "drive",
    "observer": "observe",
    "admin": "admin",
    "drive": "drive",
    "observe": "observe",
    "agent": "agent",
}
UNITS_S = {"min": 60.0, "h": 3600.0, "d": 86_400.0}
ABSENT = "this daemon invites nobody: its configuration does not say [invitations] enabled = true"


def duration_s(ctx: click.Context, param: click.Parameter, value: str | None) -> float | None:
    """A duration with its unit, such as 8h, in seconds."""
    if value is None:
        return None
    match = re.fullmatch(r"(\d{1,5})(min|h|d)", value)
    if match is None:
        raise click.BadParameter(f"expected a number with min, h or d, such as 8h, got {value!r}")
    return int(match[1]) * UNITS_S[match[2]]


@click.command()
@click.argument("role", type=click.Choice(list(ROLES)))
@click.option(
    "--for",
    "access_s",
    callback=duration_s,
    metavar="8h",
    help="How long its access lasts; else until revoked.",
)
@click.option(
    "--open",
    "lifetime_s",
    callback=duration_s,
    default="5min",
    show_default=True,
    help="How long it can be used.",
)
@click.option("--approve", is_flag=True, help="Somebody must approve the phone: chefbotctl guests approve.")
@click.option("--name", default="", help="Whom it is for.")
@click.pass_obj
def invite(
    context: CommandContext, role: str, access_s: float | None, lifetime_s: float, approve: bool, name: str
) -> None:
    """Let one phone in: print a QR code to scan, its link, and a short code to type."""
    asked: dict[str, Any] = {
        "role": ROLES[role],
        "access_s": access_s,
        "lifetime_s": lifetime_s,
        "approval": approve,
        "name": name,
    }
    made = context.run_with_client(lambda robot: robot.call("make_invitation", **asked), absent=ABSENT)
    if context.as_json:
        echo(json.dumps(made))
        return
    echo(terminal_qr(made["qr"]))
    echo(made["link"])
    echo(f"or type the code {made['code']} on the page, within {made['code_lifetime_s'] / 60:g} min")
    echo(f"Invitation {made['invitation']} for one {made['role']}, open for {made['lifetime_s'] / 60:g} min.")
    if made["on_this_computer_only"]:
        echo("Only this computer reaches the page: set page.host to let phones reach it.")


@click.group(invoke_without_command=True)
@click.pass_context
def guests(ctx: click.Context) -> None:
    """List, approve and revoke invitations and those who were let in.

    Without a command, list them.
    """
    if ctx.invoked_subcommand is None:
        ctx.invoke(list_)


@guests.command("list")
@click.pass_obj
def list_(context: CommandContext) -> None:
    """List the open invitations, and those who were let in."""
    overview = context.run_with_client(lambda robot: robot.call("list_invitations"), absent=ABSENT)
    if context.as_json:
        echo(json.dumps(overview))
        return
    for invitation in overview["invitations"]:
        told_of = f"{invitation['role']}  {invitation['name']}  open for {invitation['expires_in_s']:.0f} s"
        waits = f", {invitation['device']} waits for approval" if invitation["device"] else ""
        echo(f"invitation {invitation['invitation']}  {told_of}{waits}")
    for device in overview["devices"]:
        until = (
            "until it is revoked" if device["expires_s"] is None else f"until {_local(device['expires_s'])}"
        )
        echo(f"device {device['device']}  {device['role']}  {device['name']}  {until}")
    if not overview["invitations"] and not overview["devices"]:
        echo("nobody was invited")


def _local(stamp_s: float) -> str:
    return datetime.fromtimestamp(stamp_s).astimezone().strftime("%Y-%m-%d %H:%M")


@guests.command("approve")
@click.argument("invitation", type=int)
@click.pass_obj
def approve_(context: CommandContext, invitation: int) -> None:
    """Let in the phone that waits with an INVITATION."""
    _ask(context, "approve_invitation", invitation=invitation)


@guests.command("revoke")
@click.argument("kind", type=click.Choice(["device", "invitation"]))
@click.argument("number", type=int)
@click.pass_obj
def revoke(context: CommandContext, kind: str, number: int) -> None:
    """End the access of a device, or close an invitation, by its NUMBER in the list."""
    _ask(context, "revoke_access", **{kind: number})


def _ask(context: CommandContext, name: str, **params: Any) -> None:
    context.run_with_client(lambda robot: robot.call(name, **params), absent=ABSENT)
    echo("done")
