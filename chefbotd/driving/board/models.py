"""The board: the topics ``link``, ``firmware``, ``reset``, ``text`` and ``raw``."""

from typing import Annotated, Literal

from msgspec import Meta

from chefbotd.core import events
from chefbotd.core.events import Direction
from chefbotd.core.events.board import FirmwareData
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence
from chefbotd.rpc.topics import Topic, same_names


class LinkData(Record, frozen=True):
    """The serial link; ``reason`` says why it is down, or up and not healthy."""

    state: Literal["up", "down"]
    device: str
    reason: str
    healthy: Annotated[
        bool | None, Meta(description="whether a board is talking; null until it is known")
    ] = False
    condition: Annotated[
        str,
        Meta(
            description="healthy, silent, wrong_baud, wrong_device, echo_stuck, not_negotiated, counts_differ, "
            "lines_refused, wrong_time_unit, shared_port, unknown or down"
        ),
    ] = "down"


class RawData(Record, frozen=True):
    """A line as it was on the wire; bytes beyond ASCII are escaped in hexadecimal."""

    direction: Direction
    line: str


class TextData(Record, frozen=True):
    """A line of text from the board."""

    text: str


class ResetData(Record, frozen=True):
    """The progress of a requested restart of the board; ``reason`` says what to do, if anything."""

    stage: Annotated[
        str, Meta(description="stopping, asked; at the end restarted, not_restarted, no_answer or link_lost")
    ]
    reason: str


LinkEvent = events.LinkOpened | events.LinkHealthChanged | events.LinkNotOpened | events.LinkClosed


def link_data(event: LinkEvent | None) -> LinkData:
    """The link's state; without an event so far (None) it is down."""
    match event:
        case events.LinkOpened():
            return LinkData(state="up", device=event.device, reason="", healthy=None, condition="unknown")
        case events.LinkHealthChanged():
            return LinkData(
                state="up",
                device=event.device,
                reason=event.reason,
                healthy=event.healthy,
                condition=event.condition,
            )
        case events.LinkNotOpened() | events.LinkClosed():
            return LinkData(state="down", device=event.device, reason=event.reason)
    return LinkData(state="down", device="", reason=Sentence("board.not_opened_yet", "not opened yet"))


def _raw(event: events.LineSeen) -> RawData:
    return RawData(direction=event.direction, line=event.line.decode("ascii", "backslashreplace"))


TOPICS = (
    Topic(
        "link",
        (events.LinkOpened, events.LinkHealthChanged, events.LinkNotOpened, events.LinkClosed),
        LinkData,
        link_data,
        always_known=True,
        for_guests=True,
    ),
    Topic("firmware", (events.FirmwareReported,), FirmwareData, same_names(FirmwareData), for_guests=True),
    Topic("reset", (events.BoardResetProgressed,), ResetData, same_names(ResetData)),
    Topic("text", (events.TextReceived,), TextData, same_names(TextData)),
    Topic("raw", (events.LineSeen,), RawData, _raw, on_demand=True),
)
