"""The simulated robot in place of a real one, for the daemon's process: its clock, its board, what it lends others."""

import asyncio
import selectors
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import uvloop

from chefbotd.clock import Clock, SystemClock
from chefbotd.component_context import ConnectedHardware
from chefbotd.components.simulation.embedded import EmbeddedBoard
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.process.simulated_robot import simulation_of
from chefbotd.shared_clock import SharedClock

if TYPE_CHECKING:
    from chefbotd.settings import Settings

Ready = list[tuple[selectors.SelectorKey, int]]


class _TickingSelector(selectors.DefaultSelector):
    def __init__(self, clock: SharedClock) -> None:
        super().__init__()
        self._clock = clock
        self._ticks = self.register(clock.socket, selectors.EVENT_READ)

    def select(self, timeout: float | None = None) -> Ready:
        """What is ready, or nothing once the clock has gone on for so long."""
        clock = self._clock
        until_s = None if timeout is None else clock.now_s() + max(timeout, 0.0)
        ready = self._look(0)
        while not ready and (until_s is None or clock.now_s() < until_s):
            clock.done()
            ready = self._look(None)
        return ready

    def _look(self, timeout_s: float | None) -> Ready:
        ready = super().select(timeout_s)
        others = [entry for entry in ready if entry[0] is not self._ticks]
        if len(others) < len(ready):
            self._clock.receive()
        return others


class SharedClockLoop(asyncio.SelectorEventLoop):
    """An event loop on a clock that several programs share: it waits for the next tick, or for input.

    Time is as that clock has it. What comes from programs that do not keep to it is not waited for.
    """

    def __init__(self, clock: SharedClock) -> None:
        self._clock = clock
        super().__init__(_TickingSelector(clock))

    def time(self) -> float:
        """Seconds on the shared clock."""
        return self._clock.now_s()


def clock_of(settings: "Settings") -> tuple[Clock, Callable[[], asyncio.AbstractEventLoop]]:
    """The clock, and how to make its loop; the robot may share one with others."""
    path = settings.of("sim", SimulationParameters).shared_clock
    if path is None:
        return SystemClock(), uvloop.new_event_loop
    clock = SharedClock(path)
    return clock, partial(SharedClockLoop, clock)


@contextmanager
def connect(settings: "Settings", clock: Clock) -> Iterator[ConnectedHardware]:
    """Plug in the simulated board and lidars, for as long as the block lasts."""
    with EmbeddedBoard(simulation_of(settings), clock) as board:
        link = settings.link.model_copy(update={"device": str(board.device)})
        lidars = tuple(
            [
                lidar.model_copy(update={"device": str(board.lidar_devices[lidar.name])})
                for lidar in settings.lidar
            ]
        )
        plugged = settings.model_copy(update={"link": link, "lidar": lidars})
        yield ConnectedHardware(plugged, board.run, {"simulation": board, **_worker_on_clock(settings)})


def _worker_on_clock(settings: "Settings") -> dict[str, Any]:
    """What starts a worker on the clock that the robot shares; empty: it has the computer's."""
    path = settings.of("sim", SimulationParameters).shared_clock
    if path is None:
        return {}
    from chefbotd.components.worker.spawn import spawn

    return {"worker": partial(spawn, shared_clock=path)}
