"""Makes sentences for ``/log`` from important events."""

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from chefbotd.recording.foxglove import ERROR, INFO, WARNING

Sentence: TypeAlias = tuple[int, str, str]
"""How bad it is, who says it, and what."""


def _safety(event: Any) -> Sentence:
    text = f"{event.mode}: {event.reason}" if event.reason else event.mode
    if event.limited_by:
        text += f" (limited by {event.limited_by})"
    if event.fault is not None:
        return ERROR, "safety", f"{text} [{event.fault}]"
    return INFO, "safety", text


def _link_health(event: Any) -> Sentence:
    if event.healthy:
        return INFO, "link", f"{event.device} is healthy"
    return WARNING, "link", f"{event.condition}: {event.reason}"


def _lidar(event: Any) -> Sentence:
    return (INFO if event.healthy else WARNING), event.lidar, event.reason or event.condition


def _camera(event: Any) -> Sentence:
    return (INFO if event.healthy else WARNING), event.camera, event.reason or "sends images"


def _state(name: str) -> Callable[[Any], Sentence]:
    def told(event: Any) -> Sentence:
        return INFO, name, f"{event.state}: {event.reason}" if event.reason else event.state

    return told


SENTENCES: Mapping[str, Callable[[Any], Sentence]] = {
    "SafetyChanged": _safety,
    "LinkOpened": lambda event: (INFO, "link", f"open: {event.device}"),
    "LinkClosed": lambda event: (WARNING, "link", f"closed: {event.reason}"),
    "LinkNotOpened": lambda event: (WARNING, "link", f"cannot be opened: {event.reason}"),
    "LinkHealthChanged": _link_health,
    "BoardRestarted": lambda event: (WARNING, "board", f"has restarted: {event.cause}"),
    "BoardResetProgressed": lambda event: (INFO, "board", f"reset {event.stage}: {event.reason}"),
    "TextReceived": lambda event: (INFO, "board", event.text),
    "LidarChanged": _lidar,
    "DepthCameraChanged": _camera,
    "ControlChanged": lambda event: (
        INFO,
        "control",
        ", ".join(f"{source}: {name}" for source, name in event.holders.items()) or "nobody has control",
    ),
    "MapLoaded": lambda event: (INFO, "maps", f"{event.name}, version {event.version}, is in use"),
    "MappingChanged": _state("mapping"),
    "LocalizationChanged": _state("localization"),
    "NavigationChanged": _state("navigation"),
    "WorkerReported": _state("worker"),
    "EventsDropped": lambda event: (ERROR, "recording", f"{event.count} events are missing: {event.reason}"),
    "ServiceFailed": lambda event: (ERROR, "daemon", event.reason),
}
"""By the event's class. What appears twice in a row by the same one is written once."""
