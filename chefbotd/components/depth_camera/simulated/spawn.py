"""Starts a simulated camera in the place of the configured one: in a process of its own, or on the loop of a test."""

import asyncio

import numpy as np

from chefbotd.components.depth_camera.link.child import ScanWriter
from chefbotd.components.depth_camera.link.process import DepthChild, Spawn, spawn_program
from chefbotd.components.depth_camera.link.sources import Frame
from chefbotd.components.depth_camera.parameters import DepthSourceParameters
from chefbotd.components.depth_camera.simulated.depth_image import DepthRenderer
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.embedded import EmbeddedBoard
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.rooms import scene_of
from chefbotd.components.simulation.scene import Scene

PROGRAM = ("-m", "chefbotd.components.depth_camera.simulated.camera_process")


class SimulatedDepthChild:
    """The bytes that a camera's process would write, from the robot's true pose."""

    def __init__(
        self, parameters: DepthSourceParameters, scene: Scene, board: BoardRunner, seed: int
    ) -> None:
        self._renderer, self._writer = DepthRenderer(parameters, scene), ScanWriter(parameters)
        self._board, self._period_s = board, 1 / parameters.rate_hz
        self._chance = np.random.default_rng(seed)

    async def read(self) -> bytes:
        """The next scan, once it is due."""
        await asyncio.sleep(self._period_s)
        now_s = asyncio.get_running_loop().time()
        pose, discs = self._board.truth(now_s).world_from_base, self._board.crowd.discs
        return self._writer.encode_scan(Frame(now_s, self._renderer.image(pose, discs, self._chance)))

    async def end(self) -> str:
        """Release nothing: there is no process."""
        return "ended"


def spawn_simulated(board: BoardRunner | EmbeddedBoard, sim: SimulationParameters) -> Spawn:
    """What starts a camera that sees the world of this board, independent of the configured source."""
    if isinstance(board, EmbeddedBoard):
        return spawn_with(str(board.share_truth()), sim)

    async def spawn(parameters: DepthSourceParameters) -> DepthChild:
        scene = scene_of(sim.world.map_path, sim.world.closed_doors)
        return SimulatedDepthChild(parameters, scene, board, sim.seed)

    return spawn


def spawn_with(truth: str, sim: SimulationParameters) -> Spawn:
    """Starts a process for a camera, which reads the robot's true pose from this file."""

    async def spawn(parameters: DepthSourceParameters) -> DepthChild:
        return await spawn_program(parameters, *PROGRAM, truth, sim.model_dump_json())

    return spawn
