"""The command flash of chefbotctl."""

import json
import os
import shutil
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError

if TYPE_CHECKING:
    from chefbotd.components.doctor.listening.ports import SerialPort
    from chefbotd.components.flash.boards import Board, Programmer
    from chefbotd.components.flash.images import Image
    from chefbotd.components.flash.procedure import FlashedBoard, Tell
    from chefbotd.components.flash.turns import Turned

YES = "yes"
BOARD_NAMES = ("tiva", "duemilanove")


@click.command()
@click.option(
    "--board", "board_name", type=click.Choice(BOARD_NAMES), help="The board; by its USB port otherwise."
)
@click.option("--port", "device", metavar="DEV", help="Its serial port; the only board's otherwise.")
@click.option(
    "--image",
    "own_image",
    metavar="FILE",
    type=click.Path(exists=True, dir_okay=False, resolve_path=True, path_type=Path),
    help="Write this program (.hex or .bin) instead: the one that was kept, to go back.",
)
@click.option("--dry-run", is_flag=True, help="Say what would be done, and touch nothing.")
@click.option("--yes", "-y", "confirmed", is_flag=True, help="The wheels are off the ground: do not ask.")
@click.pass_obj
def flash(
    context: CommandContext,
    board_name: str | None,
    device: str | None,
    own_image: Path | None,
    dry_run: bool,
    confirmed: bool,
) -> None:
    """Put the firmware that stops by itself on the robot's board.

    Stops the motors, keeps the board's old program in a file, writes the new one and verifies it, and listens until
    the board names itself. Then it asks for ten turns of each wheel by hand, which measure what a turn counts. Says at
    the end how to go back. Needs openocd or lm4flash (Tiva), or avrdude (Duemilanove).
    """
    from chefbotd.components.flash import old_program, procedure, turns

    board, port = _board_and_port(board_name, device)
    image = _image(board, own_image)
    programmer = _programmer(board)
    if image.path.suffix not in programmer.formats:
        raise ProgramError(
            Exit.FAILED,
            f"{image.path}: {programmer.program} writes {' or '.join(programmer.formats)} files only",
        )
    tell = (lambda line: None) if context.as_json else echo
    named = f"firmware {image.version}" if image.version else str(image.path)
    tell(f"{board.title} at {port.device}: {named}, with {programmer.program}.")
    if dry_run:
        tell(f"Would run: {procedure.format_command(programmer.write(port, image.path))}")
        _print_json(context, board, port, programmer, image, dry_run=True)
        return
    _require_free(port)
    if not confirmed:
        _ask(port)
    procedure.stop_motors(port, tell)
    folder = _kept_folder()
    kept = old_program.keep_old_program(programmer, port, board, folder, datetime.now(), tell)
    marker, kept = old_program.begin_write(board, port, folder, kept, tell)
    go_back = old_program.way_back(board, port, kept)
    tell("Writing and verifying. Leave the cable in.")
    procedure.write(programmer, port, image.path, go_back, tell)
    marker.unlink()
    heard = procedure.hear(port, is_ours=bool(image.version))
    _check_heard(image, heard, go_back)
    tell(_as_sentence(heard))
    if image.version:
        turned = [] if confirmed or context.as_json else _measure_turns(port, tell)
        _, advice = turns.judge_turns(turned)
        tell(advice)
    tell(go_back)
    _print_json(context, board, port, programmer, image, kept=kept, heard=heard)


def _board_and_port(board_name: str | None, device: str | None) -> "tuple[Board, SerialPort]":
    from chefbotd.components.doctor.listening.ports import serial_ports
    from chefbotd.components.flash.boards import BOARDS, choose

    if device is not None and not Path(device).exists():
        raise ProgramError(Exit.FAILED, f"{device}: there is no such device")
    ports = serial_ports(() if device is None else (device,))
    try:
        named_board = None if board_name is None else BOARDS[board_name]
        return choose(ports, named_board, port_was_named=device is not None)
    except LookupError as error:
        raise ProgramError(Exit.FAILED, str(error)) from error


def _image(board: "Board", own_image: Path | None) -> "Image":
    from chefbotd.components.flash.images import BadImageError, packaged_image
    from chefbotd.components.flash.images import own_image as image_of

    if own_image is not None and own_image.suffix not in (".hex", ".bin"):
        raise click.UsageError(f"--image {own_image}: expected a file .hex (Intel hex) or .bin (raw)")
    try:
        return packaged_image(board.image) if own_image is None else image_of(own_image, board)
    except BadImageError as error:
        raise ProgramError(Exit.FAILED, str(error)) from error


def _programmer(board: "Board") -> "Programmer":
    """The first that is installed."""
    for programmer in board.programmers:
        if shutil.which(programmer.program):
            return programmer
    packages = " or ".join(f"'sudo apt install {programmer.package}'" for programmer in board.programmers)
    raise ProgramError(
        Exit.NOT_INSTALLED, f"no program that flashes the {board.title} is installed: {packages}"
    )


def _require_free(port: "SerialPort") -> None:
    if port.held_by:
        raise ProgramError(
            Exit.FAILED,
            f"{port.device} is held by {port.held_by}: end it first (the service: 'sudo systemctl stop chefbotd')",
        )
    if port.permission:
        raise ProgramError(Exit.FAILED, f"you may not open {port.device}: {port.permission}")


def _ask(port: "SerialPort") -> None:
    """Raise unless somebody has typed yes."""
    question = (
        f"The program of the board at {port.device} is replaced. Lift the robot so that no wheel touches the ground, "
        f"then type {YES}"
    )
    try:
        answer = click.prompt(question, default="", show_default=False, err=True)
    except click.Abort:
        answer = ""
    if answer.strip().lower() != YES:
        raise ProgramError(Exit.FAILED, f"{YES!r} was not typed: nothing was touched")


def _measure_turns(port: "SerialPort", tell: "Tell") -> "list[Turned]":
    """The turns of both wheels; none where they cannot be counted, which is told: the board is flashed all the same."""
    from chefbotd.components.flash.turns import measure_turns

    try:
        return measure_turns(port, _ask_turn)
    except ProgramError as error:
        tell(str(error))
        return []


def _ask_turn(question: str) -> bool:
    """Whether somebody has pressed Enter: not where nobody answers, or another word was typed."""
    try:
        return not click.prompt(
            f"{question} (Enter; n: do not measure)", default="", show_default=False, err=True
        ).strip()
    except click.Abort:
        return False


def _kept_folder() -> Path:
    from chefbotd.storage import state_folder

    return state_folder("firmware", os.environ, simulated=False)


def _check_heard(image: "Image", heard: "FlashedBoard", go_back: str) -> None:
    """Raise unless the board runs what was written, as far as it can be heard."""
    if not image.version or heard.version == image.version:
        return
    said = f"says {heard.line!r}" if heard.line else "is silent"
    raise ProgramError(
        Exit.FAILED,
        f"the board was programmed and verified, but {said}: firmware {image.version} was expected. {go_back}",
    )


def _as_sentence(heard: "FlashedBoard") -> str:
    if heard.version:
        return f"The board runs firmware {heard.version}: it stops by itself."
    return f"The board says: {heard.line}" if heard.line else "The board is silent."


def _print_json(
    context: CommandContext,
    board: "Board",
    port: "SerialPort",
    programmer: "Programmer",
    image: "Image",
    *,
    dry_run: bool = False,
    kept: Path | None = None,
    heard: "FlashedBoard | None" = None,
) -> None:
    if not context.as_json:
        return
    written = {
        "board": board.name,
        "port": port.device,
        "programmer": programmer.program,
        "image": str(image.path),
        "version": image.version or None,
        "dry_run": dry_run,
        "command": programmer.write(port, image.path),
        "kept": None if kept is None else str(kept),
        "heard": None if heard is None else heard.line,
    }
    echo(json.dumps(written))
