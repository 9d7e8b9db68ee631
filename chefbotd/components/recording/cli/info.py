"""Describes a recording: its topics with counts and rates, its length, its robot, and its problems."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from chefbotd.cli.common import output
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.echo import echo
from chefbotd.cli.common.exits import Exit, ProgramError, extra
from chefbotd.components.recording.encoder import REPEATED
from chefbotd.core.printable import plain

with extra("recording", "mcap", "zstandard", "lz4"):
    from chefbotd.components.recording.reader import RecordingReader

from chefbotd.components.recording.status import UnreadableRecording


@contextmanager
def open_recording(path: Path) -> Iterator[RecordingReader]:
    """A reader of the file.

    Raises:
        ProgramError: the file is no recording, or cannot be read.
    """
    try:
        yield RecordingReader(path)
    except UnreadableRecording as error:
        raise ProgramError(Exit.FAILED, str(error)) from error


OWN_METADATA = "chefbotd"
"""What a recording of the daemon has at its beginning."""


class _Topic(Struct):
    schema: str
    count: int = 0
    repeated: int = 0


def show_info(context: CommandContext, path: Path) -> None:
    """Print it."""
    with open_recording(path) as reader:
        summary = _read(reader)
    if context.as_json:
        output.say(True, summary, "")
        return
    echo("\n".join(plain(line) for line in _lines(summary)))
    rows = [
        [
            plain(topic),
            plain(row["schema"]),
            str(row["messages"]),
            "" if row["hz"] is None else f"{row['hz']:.1f}",
        ]
        for topic, row in summary["topics"].items()
    ]
    output.table(False, None, ["topic", "schema", "messages", "Hz"], rows)


def _read(reader: RecordingReader) -> dict[str, Any]:
    topics: dict[str, _Topic] = {}
    first_ns, last_ns, dropped = None, 0, 0
    for message in reader.messages():
        row = topics.setdefault(message.topic, _Topic(message.schema))
        if message.sequence == REPEATED and OWN_METADATA in reader.metadata:  # others number nothing
            row.repeated += 1
            continue
        row.count += 1
        first_ns = message.log_ns if first_ns is None else min(first_ns, message.log_ns)
        last_ns = max(last_ns, message.log_ns)
        if message.topic == "/events/EventsDropped":
            dropped += msgspec.json.decode(message.data)["count"]
    seconds = 0.0 if first_ns is None else (last_ns - first_ns) / 1e9
    return {
        "file": str(reader.path),
        "size_bytes": reader.size,
        "complete": reader.problem is None,
        "problem": reader.problem,
        "began_at_s": None if first_ns is None else first_ns / 1e9,
        "seconds": seconds,
        "messages": sum(row.count for row in topics.values()),
        "repeated": sum(row.repeated for row in topics.values()),
        "dropped": dropped,
        "robot": {**reader.metadata.get("chefbotd", {}), **reader.metadata.get("recording", {})},
        "attachments": sorted(reader.attachments),
        "topics": {
            topic: {
                "schema": row.schema,
                "messages": row.count,
                "hz": row.count / seconds if seconds else None,
            }
            for topic, row in sorted(topics.items())
        },
    }


def _lines(summary: dict[str, Any]) -> list[str]:
    robot = summary["robot"]
    size = f"{summary['size_bytes'] / 1e6:.1f} MB, {summary['messages']} messages"
    again = f", and {summary['repeated']} that repeat what held when it began" if summary["repeated"] else ""
    lines = [f"{summary['file']}: {size}{again}"]
    if summary["began_at_s"] is not None:
        began = datetime.fromtimestamp(summary["began_at_s"], UTC).strftime("%Y-%m-%d %H:%M:%S")
        lines.append(f"{summary['seconds']:.1f} s from {began} UTC on")
    if robot:
        reason = robot.get("reason", "?")  # of a file that somebody asked for it is the file's own name
        why = "" if Path(summary["file"]).name.startswith(reason) else f", recorded for: {reason}"
        text = f"robot {robot.get('robot', '?')}, chefbotd {robot.get('chefbotd', '?')}"
        lines.append(f"{text}{why}, part {robot.get('part', '?')}")
    if summary["dropped"]:
        lines.append(f"{summary['dropped']} events are missing: the disk was too slow")
    if summary["problem"]:
        lines.append(f"Beware: {summary['problem']}. What is told here is what can be read.")
    return lines
