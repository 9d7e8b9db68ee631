"""The means with which every part of a daemon is built."""

import random
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from msgspec import Struct

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.features.feature import Feature
from chefbotd.link.reconnect import Opener
from chefbotd.metrics import Metrics
from chefbotd.settings import Settings
from chefbotd.snapshot import DaemonState

if TYPE_CHECKING:
    from chefbotd.driving.inner_driver import InnerDriver
    from chefbotd.driving.service import DriveService
    from chefbotd.rpc.control_leases import ControlLeases
    from chefbotd.rpc.server import RpcServer

FeatureBuilder: TypeAlias = Callable[[Bus, Clock], Feature]

NO_SUBSTITUTES: Final[Mapping[str, Any]] = MappingProxyType({})


class DaemonContext(Struct, frozen=True):
    """One robot's configuration, bus and clock, and the functions that start threads and processes.

    ``session`` tells this run of the daemon from others. ``substitutes`` are what components use in place of their own
    processes and threads, by the component's name. ``config_file`` is where the configuration was read from; None: it is
    the packaged one, which is not written to. ``own_process``: the daemon is a program of its own, which records.
    """

    settings: Settings
    bus: Bus
    clock: Clock
    rng: random.Random
    session: str
    simulated: bool
    opener: Opener
    substitutes: Mapping[str, Any] = NO_SUBSTITUTES
    config_file: Path | None = None
    own_process: bool = False

    @property
    def wheel_names(self) -> tuple[str, ...]:
        """The wheels, in the order in which the board counts and commands them."""
        return tuple(wheel.name for wheel in self.settings.chassis.wheels)


class DaemonParts(Struct, frozen=True):
    """What the daemon is made of, for our own components: ``state`` is the state of all, ``socket`` where it listens.

    ``page`` is where the page is; None: it is not served. Both addresses wait until they are listened on. ``tokens`` is
    the server that asks for tokens, which is built last.
    """

    context: DaemonContext
    driving: "DriveService"
    leases: "ControlLeases"
    metrics: Metrics
    state: Callable[[], DaemonState]
    socket: Callable[[], Awaitable[tuple[str, int]]]
    page: Callable[[], Awaitable[tuple[str, int]]] | None
    tokens: Callable[[], "RpcServer"]

    def drive_as(self, source: str) -> "InnerDriver | None":
        """A driver inside the daemon, as this source; None where the configuration has no such source."""
        safety = self.context.settings.safety
        if source not in safety.sources:
            return None
        from chefbotd.driving.inner_driver import InnerDriver

        return InnerDriver(self.driving, self.leases, self.context.clock, source, safety.above(source))
