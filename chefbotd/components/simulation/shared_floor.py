"""Several simulated robots on one floor, each in a process of its own: each is a disc in the others' worlds.

Every robot keeps its true pose in a file, ``[sim.world] shared_truth``, whose folder has the others' files too. So
lidars and ultrasonic sensors see the other robots, and bodies stop each other. A robot whose program has ended stands
where its file says, and starts there again.
"""

import asyncio
import math
from pathlib import Path

import numpy as np

from chefbotd.clock import Clock
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.simulation import Simulation
from chefbotd.components.simulation.truth_file import SIZE, Truth, TruthReader, TruthWriter
from chefbotd.core.record import replace

SUFFIX = ".truth"
PERIOD_S = 0.02
LOOK_FOR_OTHERS_S = 1.0


class SharedFloor:
    """Writes a robot's own truth, and puts the other robots into its crowd."""

    def __init__(self, own: Path, radius_m: float) -> None:
        """Raises ``OSError``: the file cannot be made."""
        self._own, self._radius_m = own, radius_m
        self._writer = TruthWriter(own)
        self._others: dict[str, TruthReader] = {}
        self._touches, self._touched = 0, False

    async def run(self, board: BoardRunner, clock: Clock) -> None:
        """Tell 50 times a second where this robot is, and move the others to where they are, until cancelled."""
        looked_s = -math.inf
        try:
            while True:
                now_s = clock.now_s()
                if now_s >= looked_s + LOOK_FOR_OTHERS_S:
                    looked_s = now_s
                    self._look_for_others()
                self._exchange(board, now_s)
                await asyncio.sleep(PERIOD_S)
        finally:
            self._close()

    def _exchange(self, board: BoardRunner, now_s: float) -> None:
        truth = board.truth(now_s)
        self._touches += truth.in_contact and not self._touched
        self._touched = truth.in_contact
        pose = truth.world_from_base
        body = np.array([[pose.x_m, pose.y_m, self._radius_m]])
        self._writer.write(Truth(now_s, pose, body, self._touches))
        for name, reader in self._others.items():
            if (other := reader.read()) is not None:
                x_m, y_m, radius_m = other.discs[0].tolist()
                board.crowd.put(name, x_m, y_m, radius_m)

    def _look_for_others(self) -> None:
        for path in self._own.parent.glob(f"*{SUFFIX}"):
            is_whole = path.stat().st_size == SIZE
            if path != self._own and path.stem not in self._others and is_whole:
                self._others[path.stem] = TruthReader(path)

    def _close(self) -> None:
        self._writer.close()
        for reader in self._others.values():
            reader.close()


def left_where_it_stands(simulation: Simulation) -> Simulation:
    """The robot starts where its file says that it stands; without one, where its configuration says."""
    world = simulation.parameters.world
    if world.shared_truth is None or not world.shared_truth.exists():
        return simulation
    reader = TruthReader(world.shared_truth)
    truth = reader.read()
    reader.close()
    if truth is None:
        return simulation
    pose = truth.world_from_base
    start = {"start_x_m": pose.x_m, "start_y_m": pose.y_m, "start_heading_rad": pose.heading_rad}
    parameters = simulation.parameters.model_copy(update={"world": world.model_copy(update=start)})
    return replace(simulation, parameters=parameters)


def floor_of(simulation: Simulation) -> SharedFloor | None:
    """The floor that this robot shares; None: it is alone."""
    path = simulation.parameters.world.shared_truth
    return None if path is None else SharedFloor(path, simulation.parameters.body.radius_m)
