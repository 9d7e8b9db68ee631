"""What a component is built with, ours and strangers' alike."""

from typing import TYPE_CHECKING, Generic, TypeVar

from msgspec import Struct

from chefbotd.bus import Bus
from chefbotd.entries import Entries

if TYPE_CHECKING:
    from chefbotd.components.worker.process import Worker
    from chefbotd.composition.context import Context as DaemonParts
    from chefbotd.driving.inner_driver import InnerDriver
    from chefbotd.settings import Settings

S = TypeVar("S")


class Context(Struct, Generic[S], frozen=True):
    """What a component is built with; ``section`` is its own section of the configuration.

    ``driver`` moves the robot as the source of the component's name, None where ``[safety.sources]`` does not have it.
    ``worker`` runs the component's skills, None where there is no worker. ``clock`` is to be asked for the time and for
    timers, so that a recording can be replayed. ``parts`` are the daemon's own: they may change with every version.
    """

    section: S
    bus: Bus
    clock: Entries
    robot_name: str
    settings: "Settings"
    driver: "InnerDriver | None"
    worker: "Worker | None"
    parts: "DaemonParts"
