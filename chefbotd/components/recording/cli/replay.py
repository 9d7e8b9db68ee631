"""``chefbotd replay``: runs a recording again, and says whether the result is the same."""

import json
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chefbotd.cli.common.arguments import Address, address, configuration
from chefbotd.cli.common.echo import echo, tell
from chefbotd.cli.common.exits import Exit, ProgramError, require
from chefbotd.cli.programs.load import load_valid
from chefbotd.cli.programs.program import wants_json
from chefbotd.core.printable import plain

if TYPE_CHECKING:
    from chefbotd.components.recording.replay.replay import ReplayOutcome
    from chefbotd.components.recording.replay.run import Replayed

RATE = click.FloatRange(0.01, 1000.0)
SERVED = Address("127.0.0.1", 7333)


@click.command()
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--config",
    "other",
    metavar="FILE|ROBOT",
    type=configuration,
    help="Another configuration: show what it would have commanded.",
)
@click.option(
    "--rate", type=RATE, help="Replay speed; 1 is the recorded speed. Default: as fast as possible."
)
@click.option("--serve", "serves", is_flag=True, help="Show it on the command socket and the page.")
@click.option(
    "--listen", "where", type=address, metavar="HOST:PORT", help=f"Where; {SERVED} if none is given."
)
@click.option("--any-version", is_flag=True, help="Replay what another version of chefbotd recorded.")
@click.pass_context
def replay(
    ctx: click.Context,
    files: tuple[Path, ...],
    other: Path | None,
    rate: float | None,
    serves: bool,
    where: Address | None,
    any_version: bool,
) -> None:
    """Run a recording again, without a robot, and hold every event against the recorded one.

    FILE is a recording, or several that go on from each other. One that began while the robot drove is replayed from
    the state of the robot that was recorded then.

    With --config, the robot is configured otherwise: what it would have commanded is told in a table. What the robot
    would then have done is not known: it moves as it did.
    """
    if where is not None and not serves:
        raise click.UsageError("--listen needs --serve")
    require("recording", "mcap", "zstandard", "lz4")
    import structlog

    from chefbotd.components.recording.replay.recorded import NotReplayable
    from chefbotd.components.recording.replay.run import ReplayOptions, replay_files

    quiet = structlog.make_filtering_bound_logger(logging.CRITICAL)  # what was logged then is known
    structlog.configure(wrapper_class=quiet)
    shown_at = where or SERVED
    listen = (shown_at.host, shown_at.port) if serves else None
    configured = None if other is None else load_valid(other)
    if serves:
        tell(f"Shown on {shown_at}, and on the page where it is installed; Ctrl-C ends it.")
    try:
        replayed = replay_files(files, ReplayOptions(configured, rate, listen, any_version))
    except NotReplayable as problem:
        raise ProgramError(Exit.FAILED, str(problem)) from problem
    lines = _lines(replayed, is_other=other is not None)
    echo(json.dumps(_as_json(replayed)) if wants_json(ctx) else "\n".join(map(plain, lines)))
    if other is None and not replayed.outcome.exact:
        ctx.exit(Exit.NOT_DONE)


def _lines(replayed: "Replayed", *, is_other: bool) -> Iterator[str]:
    outcome = replayed.outcome
    speed = outcome.seconds / replayed.took_s if replayed.took_s > 0 else 0.0
    yield (
        f"{outcome.seconds:.1f} s of {replayed.robot}, {outcome.entries} entries, "
        f"replayed in {replayed.took_s:.1f} s ({speed:.0f} times as fast)"
    )
    if replayed.problem is not None:
        yield f"Note: {replayed.problem}; replayed up to there"
    yield from _beginning_lines(outcome)
    if outcome.lost:
        yield f"Note: {outcome.lost} events are missing from the recording"
    for problem in outcome.problems:
        yield f"Note: {problem}"
    if outcome.problem_count > len(outcome.problems):
        yield f"Note: and {outcome.problem_count - len(outcome.problems)} more of this kind"
    events = sum(outcome.comparison.counts.values())
    if outcome.first is None:
        yield f"All {events} events are the same, bit for bit."
        return
    yield f"The first difference: {outcome.first}"
    if outcome.same_since_s is not None and not is_other:
        yield f"From {outcome.same_since_s:.6f} s on all events are the same, bit for bit."
    yield from _table(replayed)
    if is_other:
        yield from _figures(replayed)


def _beginning_lines(outcome: "ReplayOutcome") -> Iterator[str]:
    if outcome.from_start:
        return
    if not outcome.from_state:
        yield "Note: the recording does not begin with the daemon, and has no state of the robot to begin from"
        return
    before = (
        f"; the {outcome.skipped_s:.1f} s before it are not replayed" if outcome.skipped_s >= 0.05 else ""
    )
    yield f"Note: it begins from the state that was recorded while the robot ran{before}"
    for part in outcome.left_out:
        yield f"Note: not in that state: {part}"


def _table(replayed: "Replayed") -> Iterator[str]:
    rows = replayed.outcome.comparison.rows
    same = sum(row.differing == 0 for row in rows.values())
    yield ""
    yield f"{'event':<24} {'recorded':>9} {'replayed':>9} {'differ':>9}  largest difference"
    for kind, row in sorted(rows.items()):
        if row.differing == 0:
            continue
        largest = f"{row.largest:.6g} ({row.field})" if row.field else ""
        yield f"{kind:<24} {row.recorded:>9} {row.replayed:>9} {row.differing:>9}  {largest}".rstrip()
    yield f"(the other {same} kinds of events are the same)"


def _figures(replayed: "Replayed") -> Iterator[str]:
    then, now = replayed.outcome.recorded_error, replayed.outcome.replayed_error
    if then.rms_rad_s is None or now.rms_rad_s is None:
        return
    yield ""
    yield f"wheel speed, target less measured: {then.rms_rad_s:.4f} rad/s rms recorded, {now.rms_rad_s:.4f} replayed"
    yield f"duty: {then.duty_rms:.1f} rms recorded, {now.duty_rms:.1f} replayed"
    yield "(the wheels turn as they did: this is what would have been commanded, not how they would have followed)"


OF_OUTCOME = (
    *("seconds", "entries", "exact", "from_start", "from_state", "skipped_s", "left_out", "same_since_s"),
    *("lost", "problems"),
)
OF_DIFFERENCE = ("stamp_s", "after", "field", "recorded", "replayed")
OF_ROW = ("recorded", "replayed", "differing", "largest", "field")


def _by_name(value: object, names: tuple[str, ...]) -> dict[str, Any]:
    return {name: getattr(value, name) for name in names}


def _as_json(replayed: "Replayed") -> dict[str, Any]:
    outcome = replayed.outcome
    first = outcome.first
    return {
        "robot": replayed.robot,
        "took_s": replayed.took_s,
        "problem": replayed.problem,
        **_by_name(outcome, OF_OUTCOME),
        "first_difference": None
        if first is None
        else {"event": first.kind, **_by_name(first, OF_DIFFERENCE)},
        "events": {kind: _by_name(row, OF_ROW) for kind, row in outcome.comparison.rows.items()},
        "wheel_speed_error_rms_rad_s": [outcome.recorded_error.rms_rad_s, outcome.replayed_error.rms_rad_s],
    }
