"""The board: its restart, and the topics ``link``, ``reset``, ``text`` and ``raw``."""

from typing import Literal, Protocol

from pydantic import Field

from chefbotd.core import events
from chefbotd.core.events import Direction
from chefbotd.rpc.method import Caller, method
from chefbotd.rpc.models import DONE, Done, NoParams, TopicData
from chefbotd.rpc.roles import Role
from chefbotd.rpc.topics import Topic


class LinkData(TopicData):
    """The serial link; ``reason`` says why it is down, or up and not healthy."""

    state: Literal["up", "down"]
    device: str
    reason: str
    healthy: bool | None = Field(
        default=False, description="whether a board is talking; null until it is known"
    )
    condition: str = Field(
        default="down",
        description="healthy, silent, wrong_baud, wrong_device, echo_stuck, unknown or down",
    )


class RawData(TopicData):
    """A line as it stood on the wire; bytes beyond ASCII are escaped in hexadecimal."""

    direction: Direction
    line: str


class TextData(TopicData):
    """A line of text from the board."""

    text: str


class ResetData(TopicData):
    """The progress of a requested restart of the board; ``reason`` says what to do, if anything."""

    stage: str = Field(
        description="stopping, asked; at the end restarted, not_restarted, no_answer or link_lost"
    )
    reason: str


class Board(Protocol):
    """What restarts the board."""

    def reset_board(self) -> None:
        """Restart it; raises ``chefbotd.core.commands.Refused`` where it is not connected."""
        ...


class BoardMethods:
    """The methods of this feature."""

    def __init__(self, board: Board) -> None:
        self._board = board

    @method(role=Role.ADMIN, moves=False)
    def reset_board(self, caller: Caller, params: NoParams) -> Done:
        """Restart the board; its counters start at zero."""
        self._board.reset_board()
        return DONE


LinkEvent = events.LinkOpened | events.LinkHealthChanged | events.LinkNotOpened | events.LinkClosed


def link_data(event: LinkEvent | None) -> LinkData:
    """The link's state; None: nothing has been heard of it, so it is down."""
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
    return LinkData(state="down", device="", reason="not opened yet")


def _raw(event: events.LineSeen) -> RawData:
    return RawData(direction=event.direction, line=event.line.decode("ascii", "backslashreplace"))


TOPICS = (
    Topic(
        "link",
        (events.LinkOpened, events.LinkHealthChanged, events.LinkNotOpened, events.LinkClosed),
        LinkData,
        link_data,
        always_known=True,
    ),
    Topic("reset", (events.BoardResetProgressed,), ResetData, ResetData.of),
    Topic("text", (events.TextReceived,), TextData, TextData.of),
    Topic("raw", (events.LineSeen,), RawData, _raw, on_demand=True),
)
