"""Gathering what goes into the support bundle: from the daemon, from the journal, from the recorder's last minutes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.exits import ProgramError
from chefbotd.cli.doctor import host, view
from chefbotd.cli.doctor.bundle import LOG_LINES, Redactor, contents, secrets_in, write_bundle
from chefbotd.client import CallError, Client
from chefbotd.doctor.finding import Finding
from chefbotd.rpc.parameters import is_loopback
from chefbotd.settings import Settings

MOST_RECORDING_BYTES = 50_000_000


async def gather_bundle(
    settings: Settings, findings: Sequence[Finding], context: CommandContext, bundle: Path, own_log: str
) -> None:
    """Write the bundle; a daemon that does not answer leaves its part out.

    Raises:
        ProgramError: it cannot be written.
    """
    figures, recordings = await _of_daemon(context)
    log = await host.command_output("journalctl", "--unit=chefbotd", f"--lines={LOG_LINES}", "--no-pager")
    configuration = settings.model_dump(mode="json", by_alias=True)
    files = contents(view.as_data(findings), configuration, figures.get("stats"), figures.get("state"), log)
    files["doctor.txt"] = own_log
    if problem := figures.get("not_asked"):
        files["daemon.txt"] = f"{problem}\n"
    secrets = [context.credentials.token or "", *secrets_in(settings.api.token_file, settings.api.tls_key)]
    write_bundle(bundle, files, Redactor(secrets), recordings)


async def _of_daemon(context: CommandContext) -> tuple[dict[str, Any], list[Path]]:
    """Its figures, and the file of its recorder's last minutes, where that is on this computer."""

    async def ask(robot: Client) -> tuple[dict[str, Any], list[Path]]:
        figures = {"stats": await robot.call("get_stats"), "state": await robot.call("get_state")}
        is_here = is_loopback(context.address.host)
        return figures, await _ring(robot) if is_here else []

    try:
        return await context.with_client(ask)
    except ProgramError as failure:
        return {"not_asked": str(failure)}, []


async def _ring(robot: Client) -> list[Path]:
    """The last minutes, written to a file by the daemon; nothing where it has no recorder, or may not write."""
    if "method.save_ring" not in robot.hello.capabilities:
        return []
    try:
        saved = Path((await robot.save_ring("doctor")).file)
    except CallError:
        return []
    return [saved] if _is_small_file(saved) else []


def _is_small_file(path: Path) -> bool:
    try:
        return path.stat().st_size <= MOST_RECORDING_BYTES
    except OSError:
        return False
