"""The means with which every part of a daemon is built."""

import random
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

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

FeatureBuilder: TypeAlias = Callable[[Bus, Clock], Feature]

DepthSpawn: TypeAlias = Callable[[Any], Awaitable[Any]]
"""Starts the process of a depth camera: ``components.depth_camera.link.process.Spawn``."""

WorkerSpawn: TypeAlias = Callable[[Any, Any], Awaitable[Any]]
"""Starts the worker's process: ``components.worker.spawn.Spawn``."""

StartWriter: TypeAlias = Callable[[Any, int], Any]
"""Starts the writer of recordings: ``components.recording.writer.WriterThread``, or a substitute in tests."""

Fit: TypeAlias = Callable[[str, Any, Any], Awaitable[Any]]
"""Computes a step of the calibration: ``components.calibration.fit_process.Fitter``."""


class Context(Struct, frozen=True):
    """One robot's configuration, bus and clock, and the functions that start threads and processes.

    ``session`` tells this run of the daemon from others. ``spawn_worker`` and ``depth_spawn`` start processes; None
    starts the real ones. Without ``start_writer`` nothing is recorded. Calibration writes to ``config_file`` (None: the
    robot runs with the packaged one, which is not written to), and computes by ``fit`` (None: in a process of its own).
    """

    settings: Settings
    bus: Bus
    clock: Clock
    rng: random.Random
    session: str
    simulated: bool
    opener: Opener
    spawn_worker: WorkerSpawn | None
    depth_spawn: DepthSpawn | None
    start_writer: StartWriter | None
    config_file: Path | None = None
    fit: Fit | None = None

    @property
    def wheel_names(self) -> tuple[str, ...]:
        """The wheels, in the order in which the board counts and commands them."""
        return tuple(wheel.name for wheel in self.settings.chassis.wheels)


class DaemonParts(Struct, frozen=True):
    """What the daemon is made of, for our own components: ``state`` is the state of all, ``socket`` where it listens.

    ``page`` is where the page is; None: it is not served. Both addresses wait until they are listened on.
    """

    context: Context
    driving: "DriveService"
    leases: "ControlLeases"
    metrics: Metrics
    state: Callable[[], DaemonState]
    socket: Callable[[], Awaitable[tuple[str, int]]]
    page: Callable[[], Awaitable[tuple[str, int]]] | None

    def drive_as(self, source: str) -> "InnerDriver | None":
        """A driver inside the daemon, as this source; None where the configuration has no such source."""
        safety = self.context.settings.safety
        if source not in safety.sources:
            return None
        from chefbotd.driving.inner_driver import InnerDriver

        return InnerDriver(self.driving, self.leases, self.context.clock, source, safety.above(source))
