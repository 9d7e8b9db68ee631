"""Drives of the simulated robot, recorded off the bus."""

import asyncio
from collections.abc import Awaitable, Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from chefbotd.bus import Bus, Inbox
from chefbotd.clock import Clock, run_virtual
from chefbotd.components.recording.replay.build import replayed_daemon
from chefbotd.components.recording.replay.entries import ReplayEntries
from chefbotd.components.recording.replay.recorded import Recorded, from_beginning, groups_of
from chefbotd.components.recording.replay.replay import Replay, ReplayOutcome
from chefbotd.components.worker.spawn import Spawn
from chefbotd.composition.context import FeatureBuilder
from chefbotd.core.events.inputs import DaemonStarted
from chefbotd.event_classes import encode
from chefbotd.features.feature import Feature
from chefbotd.inputs import inputs_of
from chefbotd.settings import Settings
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from chefbotd.testing.recording import write_inline
from chefbotd.testing.worker import no_worker

Script = Callable[[SimulatedRobot], Awaitable[None]]


class BusRecorder:
    """A feature that keeps every event in memory."""

    def __init__(self) -> None:
        self.inbox: Any = None

    def feature(self, bus: Bus, clock: Clock) -> Feature:
        """What the daemon is built with."""
        self.inbox = bus.subscribe_all(10_000_000)
        inputs_of(clock).begin_recording()
        return Feature("recorder")

    def events(self) -> list[Any]:
        """All that was recorded."""
        return [self.inbox.take_event() for _ in range(len(self.inbox))]


async def driven(
    script: Script, settings: Settings, recorder: FeatureBuilder, spawn_worker: Spawn = no_worker
) -> None:
    """Run a script against the simulated robot."""
    async with simulated_robot(settings, features=[recorder], spawn_worker=spawn_worker) as robot:
        await script(robot)


def recorded(script: Script, settings: Settings, spawn_worker: Spawn = no_worker) -> list[Any]:
    """What a recorder takes off the bus while the script drives, on the virtual clock."""
    recorder = BusRecorder()
    run_virtual(driven(script, settings, recorder.feature, spawn_worker))
    return recorder.events()


class LateRecorder:
    """Begins to keep every event when it is told to: first of all what the daemon remembers."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._daemon, self._inbox = robot.daemon, Inbox[Any](robot.daemon.bus, (), 1, ())

    def begin(self) -> None:
        """From now on."""
        self._inbox = self._daemon.bus.subscribe_all(10_000_000)
        self._daemon.entries.begin_recording()
        self._daemon.bus.publish(self._daemon.state.record())

    def events(self) -> list[Any]:
        """All that was recorded."""
        return self._inbox.take_all()


def recorded_late(
    script: Callable[[SimulatedRobot, LateRecorder], Awaitable[None]],
    settings: Settings,
    spawn_worker: Spawn = no_worker,
) -> list[Any]:
    """What a recorder takes off the bus that the script begins."""

    async def run() -> list[Any]:
        async with simulated_robot(settings, spawn_worker=spawn_worker) as robot:
            recorder = LateRecorder(robot)
            await script(robot, recorder)
        return recorder.events()

    return run_virtual(run())


def recorded_file(script: Script, settings: Settings, folder: Path, **recording: object) -> Path:
    """The first file of a recording that begins with the daemon, unless ``auto_start`` is False."""
    wanted = {"folder": folder, "auto_start": True, "ring_s": 0.0, "min_free_mb": 0.0, **recording}
    chosen = settings.recording.model_copy(update=wanted)
    made = settings.model_copy(update={"recording": chosen})

    async def run() -> None:
        async with simulated_robot(made, start_writer=write_inline) as robot:
            await script(robot)

    run_virtual(run())
    return min(folder.glob("*.mcap"), key=lambda path: len(path.name))


def recorded_of(events: Iterable[Any]) -> Iterator[Recorded]:
    """Events that were taken off the bus, as they are in a file."""
    for number, event in enumerate(events, 1):
        yield Recorded(number, type(event).__name__, encode(event))


def replayed(events: list[Any], settings: Settings, *, own_timers: bool = False) -> ReplayOutcome:
    """A replay of these events."""
    entries = ReplayEntries()
    started = next((each for each in events if isinstance(each, DaemonStarted)), None)
    daemon = replayed_daemon(settings, started, entries)
    replay = Replay(daemon, entries, own_timers=own_timers)
    _, groups = from_beginning(groups_of(recorded_of(events)))
    return asyncio.run(replay.run(groups))
