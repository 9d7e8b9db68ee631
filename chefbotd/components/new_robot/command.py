"""The command ``chefbotctl new-robot``."""

import os
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo, tell
from chefbotd.cli.common.exits import Exit, ProgramError

if TYPE_CHECKING:
    from chefbotd.components.new_robot.interview import Interview
    from chefbotd.components.new_robot.walk import Walk
    from chefbotd.settings import Settings

NOT_ASKED = "everything that was not asked yet"


@click.command("new-robot")
@click.argument("path", metavar="FILE.toml", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--port", "device", metavar="DEV", help="The board's port, instead of looking behind each.")
@click.pass_obj
def new_robot(context: CommandContext, path: Path, device: str | None) -> None:
    """Ask for a robot of your own, question by question, and write its configuration to FILE.toml.

    Finds the board's port and its lines, and measures counts, motors and track with you. What is not known is skipped by
    Enter. Motors turn only where you have typed yes. The file says only what differs from a packaged robot. Where it is
    there already, it is changed only after you have seen what would change. No daemon may run.
    """
    from chefbotd.components.doctor.cli.bundle import keep_log
    from chefbotd.components.new_robot.interview import NobodyAnswersError

    if path.suffix != ".toml":
        raise click.UsageError(f"{path}: the name of a robot's file ends in .toml")
    _require_writable(path)
    present = _present(path)
    keep_log()  # what the daemons that measure say would hide the questions
    walk, interview = _walk(path, present)
    try:
        is_done = context.run(converse(interview, walk, device, path, is_new=present is None))
    except (KeyboardInterrupt, NobodyAnswersError) as end:
        _keep_unfinished(path, walk, is_new=present is None)
        if isinstance(end, KeyboardInterrupt):
            raise
        raise ProgramError(Exit.NOT_DONE, "nobody answers any more") from end
    if is_done:
        _say_next(path, walk, is_new=present is None)


async def converse(
    interview: "Interview", walk: "Walk", device: str | None, path: Path, *, is_new: bool
) -> bool:
    """Ask everything, and write it; returns whether the file says it now.

    Raises:
        NobodyAnswersError: the input has ended.
        ProgramError: the file cannot be written, or would not be valid.
    """
    await walk.walk(device)
    if is_new:
        _write_new(path, walk)
        return True
    after = _changed_text(path, walk)
    if after is None:
        return True
    if (
        await interview.text(
            f"Write this to {path}? Type yes; Enter leaves the file as it is, and this beside it."
        )
        != "yes"
    ):
        _propose(path, after)
        return False
    _write_changed(path, after)
    return True


def _require_writable(path: Path) -> None:
    """Refuse a place that cannot hold the file, before anybody has measured anything for it.

    Raises:
        ProgramError: the file, or the folder that it would be made in, may not be written.
    """
    place = path if path.exists() else next(folder for folder in path.absolute().parents if folder.exists())
    if place != path and not place.is_dir():
        raise ProgramError(Exit.FAILED, f"{path}: cannot be written: {place} is no folder")
    if not os.access(place, os.W_OK):
        raise ProgramError(Exit.FAILED, f"{path}: cannot be written: you may not write to {place}")


def _present(path: Path) -> "Settings | None":
    """The robot of a file that is there already."""
    from chefbotd.cli.programs.load import load_valid

    return load_valid(path) if path.exists() else None


def _walk(path: Path, present: "Settings | None") -> "tuple[Walk, Interview]":
    from chefbotd.clock import SystemClock
    from chefbotd.components.doctor.cli.diagnosis import TerminalAsker
    from chefbotd.components.doctor.listening.ports import serial_ports
    from chefbotd.components.new_robot.answers import unmeasured_keys
    from chefbotd.components.new_robot.board import Serial
    from chefbotd.components.new_robot.interview import Interview
    from chefbotd.components.new_robot.walk import Walk
    from chefbotd.link.port import open_port
    from chefbotd.process.own_daemon import own_daemon

    base = None if present is None else str(_values(path).get("extends", "chefbot"))
    unmeasured = frozenset() if present is None else unmeasured_keys(path.read_text(encoding="utf-8-sig"))
    interview = Interview(TerminalAsker(), tell)
    walk = Walk(
        interview,
        Serial(serial_ports, open_port, SystemClock()),
        lambda settings: own_daemon(settings, name="new-robot"),
        present,
        base,
        unmeasured,
    )
    return walk, interview


def _values(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8-sig"))


def _resolved(path: Path) -> dict[str, Any]:
    """Every value of a robot's file, with the defaults where it is valid: what is the default is no difference."""
    from chefbotd.settings import SettingsError, load
    from chefbotd.settings.loader import read_values

    try:
        return load(path).model_dump(mode="json", by_alias=True)
    except SettingsError:
        return read_values(path)


def _write_new(path: Path, walk: "Walk") -> None:
    from chefbotd.components.new_robot.answers import differing, new_file
    from chefbotd.settings import SettingsError, load, packaged

    differences = differing(walk.answers, _resolved(packaged(walk.base)))
    text = new_file(walk.base, differences, walk.missing)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        echo(text)
        raise ProgramError(
            Exit.FAILED, f"{path}: cannot be written: {error.strerror}; its text is above"
        ) from error
    try:
        load(path)
    except SettingsError as error:
        raise ProgramError(
            Exit.BAD_CONFIGURATION, f"{path} has your answers, but is not valid yet, change it: {error}"
        ) from error
    echo(text)
    echo(f"Wrote {path}.")


def _changed_text(path: Path, walk: "Walk") -> str | None:
    """The file with what has changed, which is shown; None where nothing has."""
    from chefbotd.components.calibration.calibrated_file import difference
    from chefbotd.components.new_robot.answers import differing, edit_answers

    before = path.read_text(encoding="utf-8-sig")
    changes = differing(walk.answers, _resolved(path))
    if not changes:
        echo(f"Nothing has changed: {path} stays as it is.")
        return None
    after = edit_answers(before, changes, walk.missing)
    echo(difference(path.name, before, after))
    return after


def _write_changed(path: Path, after: str) -> None:
    from chefbotd.components.calibration.calibrated_file import replace_keeping
    from chefbotd.settings import SettingsError

    try:
        kept = replace_keeping(path, after)
    except (OSError, SettingsError) as error:
        raise ProgramError(Exit.FAILED, f"{path} was not changed: {error}") from error
    echo(f"Wrote {path}; it was {kept}.")


def _propose(path: Path, after: str) -> None:
    """Write beside a file what it could be: nobody wants to measure twice.

    Raises:
        ProgramError: it cannot be written.
    """
    proposed = path.with_name(f"{path.stem}.proposed.toml")
    try:
        proposed.write_text(after, encoding="utf-8")
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"{proposed}: cannot be written: {error.strerror}") from error
    echo(f"{path} was not changed; what was measured is in {proposed}.")


def _keep_unfinished(path: Path, walk: "Walk", *, is_new: bool) -> None:
    """Write a new robot's answers so far: nobody wants to turn wheels twice."""
    if not is_new:
        tell(f"Interrupted: {path} is not changed.")
        walk.missing.append(NOT_ASKED)
        if (after := _changed_text(path, walk)) is not None:
            _propose(path, after)
    elif len(walk.answers) > 1:
        tell("Interrupted: what is known so far is written; this command goes on from it.")
        walk.leave_out_unasked()
        walk.missing.append(NOT_ASKED)
        _write_new(path, walk)
    else:
        tell("Nothing was written.")


def _say_next(path: Path, walk: "Walk", *, is_new: bool) -> None:
    """The commands that come next, in their order."""
    settings = _present(path)
    if settings is None:
        return
    still = f", and still {walk.base}'s" if is_new else " this time"
    for key in walk.missing:
        echo(f"Not measured{still}: {key}.")
    steps = [
        (f"chefbotd check-config {path}", "the values that matter"),
        (f"chefbotd run --sim --config {path}", "try it on a simulated robot first"),
        (f"chefbotd run --config {path}", "then, with the robot:"),
        ("chefbotctl doctor --motors", "on blocks: signs, plugs, scale"),
    ]
    if "encoders.counts_per_turn" in walk.missing:
        steps.append(("chefbotctl calibrate encoders --apply", "ten turns by hand, before anything drives"))
    steps.append(("chefbotctl calibrate motors --space 0.5 --apply", "dead zone, gain, gains"))
    if settings.battery is not None:
        steps.append(("chefbotctl calibrate battery --apply", "with a voltmeter"))
    if settings.imu is not None:
        steps.append(("chefbotctl calibrate imu --apply", "what it shows of a turn"))
    if settings.lidar:
        steps.append(("chefbotctl calibrate wheels --apply", "radii, track, the lidar's mount: by its scans"))
    else:
        steps.append(
            ("chefbotctl calibrate umbmark --space 2 --apply", "track and radii, by loops from a mark")
        )
    width = max(len(command) for command, _ in steps)
    echo("Next:")
    for command, why in steps:
        echo(f"  {command:<{width}}  # {why}")
