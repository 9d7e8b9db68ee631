"""A simulated depth camera without its own process, on the virtual clock."""

import asyncio
from collections.abc import Awaitable, Callable

import numpy as np

from chefbotd.link.depth.child import ScanWriter
from chefbotd.link.depth.process import DepthChild
from chefbotd.link.depth.sources import Frame
from chefbotd.perception.depth_camera import DepthSourceParameters
from chefbotd.sim.board import BoardRunner
from chefbotd.sim.depth_image import DepthRenderer
from chefbotd.sim.rooms import scene_of
from chefbotd.sim.scene import Scene
from chefbotd.sim_parameters.simulation import SimulationParameters


class SimulatedDepthChild:
    """What a camera's process would write, from where the robot truly is."""

    def __init__(
        self, parameters: DepthSourceParameters, scene: Scene, board: BoardRunner, seed: int
    ) -> None:
        self._renderer, self._writer = DepthRenderer(parameters, scene), ScanWriter(parameters)
        self._board, self._period_s = board, 1 / parameters.rate_hz
        self._chance = np.random.default_rng(seed)

    async def read(self) -> bytes:
        """A scan, when it is due."""
        await asyncio.sleep(self._period_s)
        now_s = asyncio.get_running_loop().time()
        pose, discs = self._board.truth(now_s).world_from_base, self._board.crowd.discs
        return self._writer.messages(Frame(now_s, self._renderer.image(pose, discs, self._chance)))

    async def end(self) -> str:
        """Nothing is left behind."""
        return "ended"


def depth_spawn(
    board: BoardRunner, sim: SimulationParameters
) -> Callable[[DepthSourceParameters], Awaitable[DepthChild]]:
    """Starts the simulated camera in the place of the configured one's process."""

    async def spawn(parameters: DepthSourceParameters) -> DepthChild:
        scene = scene_of(sim.world.map_path, sim.world.closed_doors)
        return SimulatedDepthChild(parameters, scene, board, sim.seed)

    return spawn
