"""What the skill ``mapping`` is asked; it tells the events of ``core.events.mapping``.

The daemon's side loads neither numpy nor a compiler.
"""

from pathlib import Path
from typing import Final, TypeAlias

import msgspec

from chefbotd.components.mapping.algorithms.parameters import MappingParameters
from chefbotd.components.worker.messages import Message
from chefbotd.core.parameters import Parameters

SKILL: Final = "mapping"


class MappingSkillParameters(Parameters):
    """What the daemon tells the skill when it starts it; ``session`` is new with each start of the daemon.

    Of ``lidars`` the first leads: a scan has its time.
    """

    lidars: tuple[str, ...]
    folder: Path
    versions_kept: int
    session: str
    mapping: MappingParameters


# Requests


class Start(Message, frozen=True, tag="start"):
    """Begin a map; with a ``name``: go on with that one; ``unfinished``: with the one that was never finished.

    ``paused``: use no scans until the next ``Start``.
    """

    name: str | None = None
    unfinished: bool = False
    paused: bool = False


class ResumeMapping(Message, frozen=True, tag="resume"):
    """A new worker is to go on with what the one before it saved on its own; ``name`` as in ``MappingChanged``."""

    paused: bool
    name: str | None = None


class PauseMapping(Message, frozen=True, tag="pause"):
    """Use no scans until the next ``Start``."""


class Finish(Message, frozen=True, tag="finish"):
    """Match all scans once more, save the map under this name, and end."""

    name: str


class Discard(Message, frozen=True, tag="discard"):
    """End without saving, and forget what was saved meanwhile."""


class GetGrid(Message, frozen=True, tag="get_grid"):
    """The whole map as it is now."""


class GetStatus(Message, frozen=True, tag="get_status"):
    """How the map stands, and whether one was never finished."""


MappingRequest: TypeAlias = Start | ResumeMapping | PauseMapping | Finish | Discard | GetGrid | GetStatus

REQUEST: Final = msgspec.msgpack.Decoder(MappingRequest)
