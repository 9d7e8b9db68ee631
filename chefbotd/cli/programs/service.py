"""The commands that install chefbotd as a systemd service, and remove it."""

import json
import os
import shlex
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chefbotd.cli.common.arguments import configuration
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.programs.program import wants_json

if TYPE_CHECKING:
    from chefbotd.process.installation.steps import InstallationStep

HIDDEN_FROM_SERVICES = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")  # noqa: S108 - nothing is put there
"""ProtectHome= and PrivateTmp= of the unit: a program in one of these is not there for the service."""

ADVICE = "install it where a service finds it: docs/service.md has the Debian package, and pipx for the whole system"

dry_run = click.option("--dry-run", is_flag=True, help="Say what would be done, and do nothing.")
root = click.option(
    "--root",
    metavar="DIR",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("/"),
    callback=lambda ctx, parameter, folder: Path(os.path.abspath(folder)),  # noqa: PTH100 - systemd's tools need it without ..
    help="A folder that will be the root of a system, such as a disk image; nothing is started.",
)


@click.command()
@click.option("--robot", metavar="NAME", help="The packaged robot to begin with; chefbot by default.")
@click.option("--config", metavar="FILE", type=configuration, help="Or a configuration of your own, copied.")
@click.option(
    "--no-start", is_flag=True, help="Start it neither at boot nor now; a running service is left alone."
)
@click.option(
    "--program",
    "named",
    metavar="PATH",
    type=click.Path(path_type=Path),
    help="With --root: chefbotd's path in the system that DIR will be, where this chefbotd is not in DIR.",
)
@dry_run
@root
@click.pass_context
def install_service(
    ctx: click.Context,
    robot: str | None,
    config: Path | None,
    no_start: bool,
    named: Path | None,
    dry_run: bool,
    root: Path,
) -> None:
    """Install chefbotd as a systemd service, and start it.

    Makes the system user, /etc/chefbotd with configuration and tokens, the udev rule for /dev/chefbot, and the unit.
    What is as it should be stays, and so does a configuration that was edited: it may be run again at any time.
    """
    if robot is not None and config is not None:
        raise click.UsageError(
            "--robot and --config exclude each other: a configuration says which robot it is"
        )
    from chefbotd.cli.programs.load import bad_configuration
    from chefbotd.process.installation import plan
    from chefbotd.process.installation.steps import Host
    from chefbotd.settings import SettingsError

    program = _program()
    _require_root(program, root, dry_run=dry_run)
    if root == Path("/"):
        _require_reachable(program)
    program = program_in(root, program, named)
    request = plan.InstallRequest(program, robot or "chefbot", config, start=not no_start)
    try:
        steps = plan.install(Host(root), request)
    except SettingsError as error:
        raise bad_configuration(error) from error
    _carry_out(ctx, steps, dry_run=dry_run)


@click.command()
@click.option("--purge", is_flag=True, help="Remove configuration, tokens, maps and the user, too.")
@dry_run
@root
@click.pass_context
def uninstall_service(ctx: click.Context, purge: bool, dry_run: bool, root: Path) -> None:
    """Stop the service, and remove what install-service has installed.

    Configuration, tokens and maps stay, unless --purge is given.
    """
    from chefbotd.process.installation import plan
    from chefbotd.process.installation.steps import Host

    _require_root(_program(), root, dry_run=dry_run)
    _carry_out(ctx, plan.uninstall(Host(root), purge=purge), dry_run=dry_run)


def _carry_out(ctx: click.Context, steps: "Iterable[InstallationStep]", *, dry_run: bool) -> None:
    """Tell each step and do it; the list is the same in a dry run."""
    from chefbotd.process.installation.steps import InstallationStep, InstallError, carry_out

    rows: list[dict[str, Any]] = []
    as_json = wants_json(ctx)

    def tell(step: InstallationStep) -> None:
        rows.append({"step": step.told, "changes": step.act is not None})
        if not as_json:
            echo(step.told)

    try:
        if dry_run:
            for step in steps:
                tell(step)
        else:
            carry_out(steps, tell)
    except InstallError as error:
        raise ProgramError(Exit.FAILED, str(error)) from error
    if as_json:
        echo(json.dumps({"dry_run": dry_run, "steps": rows}))


def _program() -> Path:
    """The chefbotd that runs now: beside its interpreter, or where the shell finds it."""
    beside = Path(sys.prefix, "bin", "chefbotd")
    program = str(beside) if beside.exists() else shutil.which("chefbotd")
    if program is None:
        raise ProgramError(Exit.FAILED, f"there is no program chefbotd in {beside.parent} or on the PATH")
    return Path(program).absolute()


def program_in(root: Path, program: Path, named: Path | None) -> Path:
    """The path by which the system of ``root`` will find the program: ``named``, or that of the one that runs.

    Raises:
        ProgramError: the one that runs is not in that system; or the service could not see the one that was named.
        click.UsageError: one was named for the system that runs, or not by its whole path.
    """
    if root == Path("/"):
        if named is not None:
            raise click.UsageError("--program is for --root: here the program that runs is the service's")
        return program
    if named is None:
        if not program.is_relative_to(root.absolute()):
            reason = f"{program} is not in {root}, where the service would look for it"
            advice = "give --program, such as /opt/pipx/venvs/chefbotd/bin/chefbotd"
            raise ProgramError(Exit.FAILED, f"{reason}: {advice}")
        named = Path("/") / program.relative_to(root.absolute())
    if not named.is_absolute():
        raise click.UsageError(
            f"--program {named}: expected the whole path in the system that {root} will be"
        )
    hidden = next((name for name in HIDDEN_FROM_SERVICES if named.is_relative_to(name)), None)
    if hidden is not None:
        raise ProgramError(Exit.FAILED, f"{named} is in {hidden}, which the service cannot see: {ADVICE}")
    return named


def _require_root(program: Path, root: Path, *, dry_run: bool) -> None:
    """Only root may change the system; the command to type is the one that was typed."""
    if dry_run or root != Path("/") or os.geteuid() == 0:
        return
    typed = shlex.join(["sudo", str(program), *sys.argv[1:]])
    raise ProgramError(Exit.FAILED, f"only root may do this; run: {typed}")


def _require_reachable(program: Path) -> None:
    """The unit hides homes and temporary folders, and runs as a user of its own.

    Raises:
        ProgramError: the program, its interpreter or its packages are where the service cannot read them.
    """
    import chefbotd

    for path in (program, Path(sys.executable), Path(sys.base_prefix), Path(chefbotd.__file__)):
        real = path.resolve()
        hidden = next((name for name in HIDDEN_FROM_SERVICES if real.is_relative_to(name)), None)
        if hidden is not None:
            raise ProgramError(Exit.FAILED, f"{real} is in {hidden}, which the service cannot see: {ADVICE}")
        closed = next((folder for folder in real.parents if not folder.stat().st_mode & 0o001), None)
        if closed is not None:
            raise ProgramError(
                Exit.FAILED,
                f"{closed} cannot be read by other users, and the service runs as another user: {ADVICE}",
            )
