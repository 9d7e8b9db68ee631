"""Makes a recording on a running daemon: starts it, shows its progress, and ends it."""

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import TYPE_CHECKING, TypeVar

from chefbotd.cli.common import output
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.client import Client

if TYPE_CHECKING:
    from chefbotd.client.models import RecordedFile, RecordingData, RecordingEnded

T = TypeVar("T")
Show = Callable[[str], None]

MEGABYTE = 1e6
ABSENT = (
    "this daemon records nothing: its configuration has [recording] enabled = false, or "
    "the extra 'recording' is missing on its computer, and the daemon's log says how to add it"
)


def record(context: CommandContext, name: str | None, seconds: float | None) -> None:
    """Record until ``seconds`` are over, or until Ctrl-C, which is the usual end and no failure.

    Raises:
        ProgramError: it was refused, or the disk ended it.
    """

    async def recording(robot: Client) -> "RecordingEnded":
        started = await robot.start_recording(name)
        with _line(quiet=context.as_json) as show:
            show(f"recording {started.file}")
            watching = asyncio.ensure_future(_watch(robot, show))
            try:
                await asyncio.wait([watching], timeout=seconds)
            except asyncio.CancelledError:
                _forget_cancellation()
            finally:
                watching.cancel()
        if watching.done() and not watching.cancelled():
            watching.result()  # the disk, or the connection, ended it
        return await robot.stop_recording()

    ended = _ask(context, recording)
    text = (
        f"Recorded {ended.seconds:.1f} s, {ended.messages} messages, {_size(ended.size_bytes)}: {ended.file}"
    )
    if ended.dropped:
        text += f"\n{ended.dropped} events found no room since the daemon started: its disk is too slow."
    output.say(context.as_json, ended, text)


def _forget_cancellation() -> None:
    """Ctrl-C has done its work: what follows is not to be cancelled."""
    task = asyncio.current_task()
    if task is not None:
        task.uncancel()


async def _watch(robot: Client, show: Show) -> None:
    async with robot.subscribe("recording") as events:
        async for event in events:
            data = event.data
            if data.state == "failed":
                raise ProgramError(Exit.FAILED, f"recording has ended: {data.reason}")
            show(_progress(data))


def _progress(data: "RecordingData") -> str:
    free = "" if data.free_bytes is None else f", {_size(data.free_bytes)} free"
    lost = f", {data.dropped} events dropped" if data.dropped else ""
    reason = f" ({data.reason})" if data.reason else ""
    text = f"recording {data.name}: {data.seconds:.0f} s, {_size(data.bytes_written)}"
    return f"{text}{free}{lost}{reason} - Ctrl-C ends it"


def save_ring(context: CommandContext, name: str | None) -> None:
    """Write the last minutes into a file."""
    saved = _ask(context, lambda robot: robot.save_ring(name))
    text = f"Wrote the last {saved.seconds:.0f} s: {saved.file}"
    output.say(context.as_json, saved, text)


def list_files(context: CommandContext) -> None:
    """Show what is in the robot's folder."""
    listed = _ask(context, lambda robot: robot.list_recordings())
    if not listed.files and not context.as_json:
        echo(f"There is no recording in {listed.folder} yet.")
        return
    rows = [
        [
            row.file,
            _size(row.size_bytes),
            datetime.fromtimestamp(row.changed_at_s).strftime("%Y-%m-%d %H:%M"),
            _condition(row),
        ]
        for row in listed.files
    ]
    output.table(context.as_json, listed, ["recording", "size", "changed", ""], rows)
    if not context.as_json:
        echo(f"In {listed.folder}, on the robot's computer.")


def _condition(row: "RecordedFile") -> str:
    if row.recording:
        return "is being recorded"
    return "" if row.complete else "was cut: readable up to where its writer ended"


def _size(count: int) -> str:
    return f"{count / MEGABYTE:.1f} MB" if count >= 100_000 else f"{count / 1e3:.1f} kB"


@contextmanager
def _line(*, quiet: bool) -> Iterator[Show]:
    """A line on stderr that changes, where there is a terminal."""
    from chefbotd.cli.common.console import Printer

    console = Printer(stderr=True, highlight=False)
    if quiet or not console.is_terminal:
        yield lambda text: None
        return
    with console.status("recording") as status:
        yield status.update


def _ask(context: CommandContext, action: Callable[[Client], Awaitable[T]]) -> T:
    return context.run_with_client(action, absent=ABSENT)
