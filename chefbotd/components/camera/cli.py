"""The commands of chefbotctl for the camera."""

import base64
import json
from pathlib import Path
from typing import Any

import click

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError

ABSENT = "this robot has no camera: its configuration does not say [camera] enabled = true"


@click.group()
def camera() -> None:
    """Look through the robot's camera."""


@camera.command()
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--wait",
    "wait_s",
    type=click.FloatRange(0.0, 10.0),
    default=10.0,
    show_default=True,
    help="How long to wait for a picture, in seconds.",
)
@click.pass_obj
def snapshot(context: CommandContext, file: Path, wait_s: float) -> None:
    """Write the next picture of the camera to FILE, as JPEG.

    The camera is switched on for it, which takes a second or more.
    """
    frame: dict[str, Any] = context.run_with_client(
        lambda robot: robot.call("get_camera_frame", wait_s=wait_s), absent=ABSENT
    )
    jpeg = base64.b64decode(frame["jpeg"])
    try:
        file.write_bytes(jpeg)
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"{file} cannot be written: {error.strerror or error}") from error
    size = f"{frame['width_px']} x {frame['height_px']}"
    if context.as_json:
        echo(json.dumps({key: value for key, value in frame.items() if key != "jpeg"} | {"file": str(file)}))
        return
    echo(f"{file}: {size}, {len(jpeg)} bytes, {frame['age_s']:.2f} s old when it was sent")


@camera.command()
@click.pass_obj
def status(context: CommandContext) -> None:
    """Print whether the camera sends pictures, and how many it has sent."""
    figures = context.run_with_client(lambda robot: robot.call("get_camera_status"), absent=ABSENT)
    if context.as_json:
        echo(json.dumps(figures))
        return
    size = f", {figures['width_px']} x {figures['height_px']}" if figures["width_px"] else ""
    age = "" if figures["age_s"] is None else f", the last picture {figures['age_s']:.2f} s old"
    reason = f": {figures['reason']}" if figures["reason"] else ""
    echo(f"{figures['source']}: {figures['state']}{reason}{size}{age}")
    counts = (
        f"{figures['pictures']} pictures, {figures['dropped']} dropped, started {figures['starts']} times"
    )
    echo(f"{counts}; {figures['viewers']} look")
