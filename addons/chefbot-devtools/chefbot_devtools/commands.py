"""The commands that chefbotctl has where this package is installed: ``shell`` and ``sweep``."""

import json
from importlib.util import find_spec
from pathlib import Path

import click

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import Client
from chefbotd.extras import how_to_add_folder


@click.command()
@click.pass_obj
def shell(context: CommandContext) -> None:
    """A Python prompt with the robot.

    ``robot`` is a connected SyncClient: robot.drive_for(2, linear_m_s=0.2). Tab completes, robot.drive_for? explains.
    Ctrl-C, and whatever raises an error, stops the robot. exit() or Ctrl-D ends; the robot brakes.
    """
    from chefbot_devtools.shell import run_shell

    async def greeting(robot: Client) -> str:
        return robot.hello.robot

    run_shell(context, context.run_with_client(greeting))


@click.command()
@click.argument("program")
@click.option(
    "--seeds",
    type=click.IntRange(1, 100_000),
    default=10,
    show_default=True,
    help="How many runs in each world.",
)
@click.option(
    "--first-seed", type=click.IntRange(0), default=1, show_default=True, help="The first run's seed."
)
@click.option(
    "--world",
    "worlds",
    multiple=True,
    default=("flat",),
    show_default=True,
    help="flat or office; may be given twice.",
)
@click.option(
    "--jobs", type=click.IntRange(1, 1024), help="Runs at the same time; by default one on each core."
)
@click.option(
    "--limit",
    "limit_s",
    type=click.FloatRange(1.0),
    default=600.0,
    show_default=True,
    help="Simulated seconds a run may take.",
)
@click.option(
    "--patience",
    "patience_s",
    type=click.FloatRange(1.0),
    default=600.0,
    show_default=True,
    help="Real seconds a run may take.",
)
@click.option(
    "--dask", metavar="ADDRESS", help="Run on the cluster of this dask scheduler, such as tcp://host:8786."
)
@click.option(
    "--plot", "picture", type=click.Path(path_type=Path, dir_okay=False), help="Draw the outcomes into a PNG."
)
@click.option("--force", is_flag=True, help="Replace the picture that there is.")
@click.pass_obj
def sweep(
    context: CommandContext,
    program: str,
    seeds: int,
    first_seed: int,
    worlds: tuple[str, ...],
    jobs: int | None,
    limit_s: float,
    patience_s: float,
    dask: str | None,
    picture: Path | None,
    force: bool,
) -> None:
    """Run PROGRAM on simulated robots, over seeds and worlds, and count the outcomes. No daemon is needed.

    PROGRAM is a Python file, or an installed module, with an async function main(robot); an optional
    simulated(world, seed) says where the robot starts, and who walks about. Each run is a process of its own on the
    virtual clock. The exit code is 6 unless every run was done.
    """
    from chefbot_devtools.job import Job, checked_program
    from chefbot_devtools.report import as_json, print_table, summary
    from chefbot_devtools.sweep import run_local, run_on_dask

    if picture is not None:
        from chefbot_devtools.plot import check_picture

        check_picture(picture, force=force)
    module, source = checked_program(program)
    listed = [
        Job(module, source, world, seed, limit_s, patience_s)
        for world in dict.fromkeys(worlds)
        for seed in range(first_seed, first_seed + seeds)
    ]
    if dask is None:
        outcomes = run_local(listed, jobs, quiet=context.as_json)
    else:
        _require_dask()
        outcomes = run_on_dask(listed, dask, quiet=context.as_json)
    if picture is not None:
        from chefbot_devtools.plot import draw

        draw(outcomes, picture, program)
    if context.as_json:
        echo(json.dumps(as_json(outcomes)))
    else:
        print_table(outcomes)
    if missed := [outcome for outcome in outcomes if outcome.end != "done"]:
        raise ProgramError(Exit.NOT_DONE, f"{len(missed)} of {len(outcomes)} runs: {summary(missed)}")


def _require_dask() -> None:
    """Raises ProgramError where it is not installed."""
    if find_spec("distributed") is None:
        advice = f"in a checkout of chefbotd, {how_to_add_folder('./addons/chefbot-devtools[dask]')}"
        raise ProgramError(Exit.NOT_INSTALLED, f"--dask needs the package distributed: {advice}")
