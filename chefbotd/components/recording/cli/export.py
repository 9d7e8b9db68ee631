"""Exports a recording as tables: a CSV file per topic, a row per message, a column per number."""

import csv
import json
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any, TextIO

from chefbotd.cli.common.add_on import ros2_add_on
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.components.recording.cli.info import open_recording
from chefbotd.components.recording.reader import RecordedMessage

WIDEST_LIST = 16
"""A longer list, such as a scan's ranges, is one cell, as JSON."""

MOST_TABLES = 500
"""Each is an open file while they are written; a recording of chefbotd has some 40."""
DEEPEST = 16
"""What is nested deeper is one cell as well."""
MAX_NAME = 100
FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")
OWN_COLUMNS = ("log_time_s", "sequence")


def export_csv(path: Path, folder: Path, topics: Collection[str], *, force: bool) -> list[Path]:
    """Write the tables; returns their files.

    Raises:
        ProgramError: the file is no recording, has not this topic, or a table cannot be written.
    """
    columns: dict[str, dict[str, None]] = {}
    with open_recording(path) as reader:
        for message in reader.messages():
            row = columns.setdefault(message.topic, dict.fromkeys(OWN_COLUMNS))
            if not topics or message.topic in topics:
                row.update(dict.fromkeys(name for name, _ in _cells(_decode_message(path, message))))
    if not columns:
        raise ProgramError(Exit.FAILED, f"{path} has no message that can be read")
    if unknown := sorted(set(topics) - columns.keys()):
        available = ", ".join(sorted(columns))
        raise ProgramError(Exit.FAILED, f"{path} has no topic {', '.join(unknown)}; it has {available}")
    chosen = [topic for topic in columns if not topics or topic in topics]
    if len(chosen) > MOST_TABLES:
        problem = (
            f"{path} has {len(chosen)} topics, more than {MOST_TABLES} tables: name some of them by --topic"
        )
        raise ProgramError(Exit.FAILED, problem)
    files = _files(folder, chosen)
    for file in files.values():
        if file.exists() and not force:
            raise ProgramError(Exit.FAILED, f"{file} exists already; --force replaces it")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write(path, files, columns)
    except OSError as error:
        raise ProgramError(Exit.FAILED, f"cannot write in {folder}: {error.strerror}") from error
    return sorted(files.values())


def export_ros2(path: Path, bag: Path) -> dict[str, int]:
    """Write a ROS 2 bag; how many messages each topic got.

    Raises:
        ProgramError: the file is no recording, the bag cannot be written, or the package for it is not installed.
    """
    bags = ros2_add_on("bag")
    with open_recording(path):
        try:
            return dict(bags.write_bag(path, bag))
        except bags.CannotWriteBagError as error:
            raise ProgramError(Exit.FAILED, str(error)) from error


def _write(path: Path, files: dict[str, Path], columns: dict[str, dict[str, None]]) -> None:
    streams: dict[str, TextIO] = {}
    try:
        writers = {}
        for topic, file in files.items():
            streams[topic] = file.open("w", newline="", encoding="utf-8")
            writers[topic] = csv.DictWriter(streams[topic], list(columns[topic]))
            writers[topic].writeheader()
        with open_recording(path) as reader:
            for message in reader.messages():
                if message.topic in writers:
                    writers[message.topic].writerow(_row(path, message))
    finally:
        for stream in streams.values():
            stream.close()


def _row(path: Path, message: RecordedMessage) -> dict[str, Any]:
    own = {"log_time_s": f"{message.log_ns / 1e9:.9f}", "sequence": message.sequence}
    return {**own, **dict(_cells(_decode_message(path, message)))}


def _decode_message(path: Path, message: RecordedMessage) -> Any:
    try:
        return json.loads(message.data)
    except (ValueError, RecursionError):
        raise ProgramError(
            Exit.FAILED,
            f"{path}: the messages on {message.topic} ({message.schema or 'without a schema'}) are not JSON, as those "
            "of chefbotd's recordings are; name the topics that are by --topic",
        ) from None


def _cells(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """The columns of a value, named by the way to each: ``velocity_rad_s.0``."""
    depth = name.count(".")
    if isinstance(value, dict) and depth < DEEPEST:
        for key, inner in value.items():
            yield from _cells(inner, f"{name}.{key}" if name else _as_text(key))
    elif isinstance(value, dict):
        yield name, json.dumps(value)
    elif isinstance(value, list) and len(value) <= WIDEST_LIST and depth < DEEPEST:
        for index, inner in enumerate(value):
            yield from _cells(inner, f"{name}.{index}")
    elif isinstance(value, list):
        yield name, json.dumps(value)
    else:
        yield name, _as_text(value) if isinstance(value, str) else value


def _as_text(text: str) -> str:
    """What a spreadsheet shows as the text that it is: with an apostrophe in front it is no formula.

    Names and reasons are other people's (OWASP, "CSV Injection").
    """
    return f"'{text}" if text.startswith(FORMULA) else text


def _files(folder: Path, topics: Iterable[str]) -> dict[str, Path]:
    """A file for each topic, whatever somebody has called it: no two are the same, and none is elsewhere."""
    files: dict[str, Path] = {}
    numbers: Counter[str] = Counter()
    for topic in topics:
        name = re.sub(r"[^\w.-]+", "_", topic.strip("/"))[:MAX_NAME].strip(".") or "topic"
        number = numbers[name.lower()]
        numbers[name.lower()] += 1
        files[topic] = folder / (f"{name}~{number + 1}.csv" if number else f"{name}.csv")
    return files
