"""The simulated robot in place of a real one, for the daemon's process: its clock, its board, what it lends others."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import uvloop

from chefbotd.clock import Clock, SystemClock
from chefbotd.component_context import ConnectedHardware
from chefbotd.components.simulation.embedded import EmbeddedBoard
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.process.shared_loop import SharedClockLoop
from chefbotd.components.simulation.process.simulated_robot import simulation_of
from chefbotd.shared_clock import SharedClock

if TYPE_CHECKING:
    from chefbotd.settings import Settings


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
