"""The commands ``chefbotctl record`` and ``chefbotctl log``."""

from pathlib import Path

import click

from chefbotd.cli.common import output
from chefbotd.cli.common.arguments import duration
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.exits import require

FILE = click.Path(path_type=Path)


@click.command()
@click.argument("name", required=False)
@click.option("--for", "seconds", type=duration, metavar="TIME", help="End after TIME: 10s, 5m or 1h.")
@click.option(
    "--ring", is_flag=True, help="Write the last minutes, which the robot keeps in memory, instead."
)
@click.pass_obj
def record(context: CommandContext, name: str | None, seconds: float | None, ring: bool) -> None:
    """Record everything that the robot sees and does, until Ctrl-C.

    The file is on the robot's computer; its name begins with NAME.
    """
    from chefbotd.components.recording.cli import recording

    if ring and seconds is not None:
        raise click.UsageError("--ring saves what has already happened, so it takes no --for")
    if ring:
        recording.save_ring(context, name)
    else:
        recording.record(context, name, seconds)


@click.group("log")
def log_group() -> None:
    """List, show, export and plot recordings."""


@log_group.command("list")
@click.pass_obj
def list_command(context: CommandContext) -> None:
    """List the recordings on the robot's computer."""
    from chefbotd.components.recording.cli import recording

    recording.list_files(context)


@log_group.command()
@click.argument("file", type=FILE)
@click.pass_obj
def info(context: CommandContext, file: Path) -> None:
    """Show what the recording FILE contains, even if a kill or a power cut ended it."""
    from chefbotd.components.recording.cli.info import show_info

    show_info(context, file)


@log_group.command()
@click.argument("file", type=FILE)
@click.option(
    "--csv", "folder", type=FILE, metavar="FOLDER", help="Write one table per topic to this folder."
)
@click.option(
    "--ros2", "bag", type=FILE, metavar="FOLDER", help="Write a ROS 2 bag; needs the package chefbot-ros2."
)
@click.option("--topic", "topics", multiple=True, metavar="TOPIC", help="Only this one; may be given again.")
@click.option("--force", is_flag=True, help="Replace files that exist.")
@click.pass_obj
def export(
    context: CommandContext,
    file: Path,
    folder: Path | None,
    bag: Path | None,
    topics: tuple[str, ...],
    force: bool,
) -> None:
    """Write the recording FILE as tables for spreadsheets and pandas, or as a ROS 2 bag.

    A bag is always written whole, and as a new folder: --topic and --force are for tables.
    """
    if (folder is None) is (bag is None):
        raise click.UsageError("expected one of --csv FOLDER and --ros2 FOLDER")
    if bag is not None:
        from chefbotd.components.recording.cli.export import export_ros2

        counts = export_ros2(file, bag)
        text = f"Wrote {sum(counts.values())} messages on {len(counts)} topics in {bag}."
        output.say(context.as_json, {"bag": str(bag), "messages": counts}, text)
        return
    assert folder is not None  # noqa: S101 - one of both was given
    from chefbotd.components.recording.cli.export import export_csv

    files = export_csv(file, folder, topics, force=force)
    result = {"files": [str(path) for path in files]}
    output.say(context.as_json, result, f"Wrote {len(files)} tables in {folder}.")


@log_group.command()
@click.argument("file", type=FILE)
@click.option(
    "--out", type=FILE, metavar="PNG", help="The picture to write; FILE's name with .png, here, by default."
)
@click.option("--force", is_flag=True, help="Replace a picture that exists.")
@click.pass_obj
def plot(context: CommandContext, file: Path, out: Path | None, force: bool) -> None:
    """Draw wheel speeds beside what was asked for, the path, the battery and the faults of the recording FILE."""
    require("plot,recording", "matplotlib", "mcap", "zstandard", "lz4")
    from chefbotd.components.recording.cli.plot import plot_png

    out = out or Path(f"{file.stem or 'recording'}.png")
    plot_png(file, out, force=force)
    output.say(context.as_json, {"png": str(out)}, f"Wrote {out}.")
