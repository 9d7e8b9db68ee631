"""The command ``chefbotd notify``: tries the configured servers, and tells that the daemon is gone."""

import asyncio
import http.client
import os
import secrets
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from chefbotd.cli.common.arguments import configuration
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.programs.load import load_valid
from chefbotd.components.notifications.parameters import NoticeKind, NotificationsParameters

if TYPE_CHECKING:
    from chefbotd.components.notifications.delivery import Post

GONE_AGAIN_S = 3600.0
"""A daemon that ends again and again is told once in this time."""

WITHIN_S = 4.0
"""How long the servers may take: systemd waits 5 s (TimeoutStopSec=)."""


@click.command()
@click.option(
    "--config",
    "path",
    metavar="FILE|ROBOT",
    type=configuration,
    required=True,
    help="The robot's TOML file.",
)
@click.option("--gone", is_flag=True, help="Tell that the daemon has ended: for systemd's ExecStopPost=.")
def notify(path: Path, gone: bool) -> None:
    """Send a message to the servers of [notifications], to try them.

    Each is tried once. With --gone it is the message that the daemon has ended: at most one an hour of an end
    that was asked for, and one of an unexpected end.
    """
    from chefbotd.components.notifications.delivery import targets_of
    from chefbotd.components.notifications.episodes import Notice

    settings = load_valid(path)
    section: NotificationsParameters = getattr(settings, "notifications")  # noqa: B009 - composed at run time
    if not section.enabled or (gone and NoticeKind.DAEMON_GONE not in section.kinds):
        if gone:
            return
        raise ProgramError(
            Exit.BAD_CONFIGURATION, "[notifications] enabled is false: nobody is told anything"
        )
    if gone and _was_told():
        return
    notice = Notice(NoticeKind.TEST, "Test", "This is a test of its notifications.", 0.0)
    if gone:
        notice = Notice(NoticeKind.DAEMON_GONE, "chefbotd has ended", _gone_text(), 0.0)
    number = secrets.token_hex(8)
    posts = {
        target.name: target.make_post(notice, settings.robot.name, 0.0, number)
        for target in targets_of(section)
    }
    errors = asyncio.run(_send_all(posts))
    if gone and len(errors) < len(posts) and (file := _told_file()) is not None:
        file.touch()
    for name in posts.keys() - errors.keys():
        echo(f"{name} has taken it")
    if errors:
        raise ProgramError(
            Exit.FAILED, "not sent: " + ", ".join(f"{name}: {error}" for name, error in errors.items())
        )


async def _send_all(posts: "Mapping[str, Post]") -> dict[str, str]:
    """Send each once, all at the same time; returns what went wrong, by the server's name."""
    from chefbotd.components.notifications.delivery import NotTaken, deliver

    errors: dict[str, str] = {}

    async def send(name: str, post: "Post") -> None:
        try:
            await deliver(post, within_s=WITHIN_S)
        except (OSError, http.client.HTTPException, NotTaken) as error:
            errors[name] = str(error) if isinstance(error, NotTaken) else type(error).__name__

    await asyncio.gather(*(send(name, post) for name, post in posts.items()))
    return errors


def _gone_text() -> str:
    """What systemd says of the end."""
    result = os.environ.get("SERVICE_RESULT", "")
    if result == "success":
        return "chefbotd has ended as it was asked to. The robot cannot be driven until it is started again."
    why = " (" + f"{result} {os.environ.get('EXIT_STATUS', '')}".strip() + ")" if result else ""
    return f"chefbotd has ended unexpectedly{why}. It no longer watches the robot, which may still be moving."


def _told_file() -> Path | None:
    """Where it is remembered that such an end was told: in systemd's RuntimeDirectory=."""
    folder = os.environ.get("RUNTIME_DIRECTORY", "").split(":")[0]
    name = "told_end" if os.environ.get("SERVICE_RESULT") == "success" else "told_unexpected_end"
    return Path(folder) / name if folder else None


def _was_told() -> bool:
    file = _told_file()
    if file is None or not file.exists():
        return False
    return 0 <= time.time() - file.stat().st_mtime < GONE_AGAIN_S
