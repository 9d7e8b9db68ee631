"""The topic ``log``: the newest sentences about the robot, also from before a client came."""

from collections.abc import Iterable
from typing import Annotated, Any

from msgspec import Meta
from msgspec.structs import asdict

from chefbotd.core.events.inputs import ServiceFailed
from chefbotd.core.record import LogLine, Record
from chefbotd.rpc.topics import Topic

MOST_LINES = 50


class StampedLine(LogLine, frozen=True):
    """A sentence about a part of the robot, and when it was said."""

    stamp_s: float


class LogData(Record, frozen=True):
    """The log's last lines, the newest last."""

    lines: Annotated[tuple[StampedLine, ...], Meta(description="at most 50")] = ()


def add_line(log: LogData | None, event: Any) -> LogData:
    """The log with what it says of this event; the same log where the line's source said that last, too."""
    line, lines = event.log_line(), () if log is None else log.lines
    before = next((said for said in reversed(lines) if said.source == line.source), None)
    if log is not None and before is not None and (before.level, before.text) == (line.level, line.text):
        return log
    return LogData((*lines[1 - MOST_LINES :], StampedLine(**asdict(line), stamp_s=event.stamp_s)))


def log_topic(others: Iterable[Topic]) -> Topic:
    """The topic ``log``, of all events of the robot's other topics of which a log says something."""
    events = [event for topic in others for event in topic.events if hasattr(event, "log_line")]
    return Topic("log", (*dict.fromkeys(events), ServiceFailed), LogData, lambda log: log, add_line)
