"""Opens a simulated camera in the place of the configured one: in a process of its own, or on the loop of a test."""

import asyncio
import sys

from chefbotd.components.camera.algorithms.jpeg import read_picture
from chefbotd.components.camera.link.command import CommandCapture
from chefbotd.components.camera.link.source import (
    ArrivedPicture,
    CameraLost,
    OpenSource,
    PictureSource,
    open_threads,
)
from chefbotd.components.camera.parameters import CameraParameters
from chefbotd.components.camera.simulated.camera_process import MOST_HZ, NO_PILLOW
from chefbotd.components.camera.simulated.picture import PictureRenderer, encode_jpeg
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.embedded import EmbeddedBoard
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.rooms import scene_of

PROGRAM = ("-P", "-m", "chefbotd.components.camera.simulated.camera_process")


class SimulatedSource:
    """Draws on the loop, when a picture is due."""

    def __init__(self, renderer: PictureRenderer, board: BoardRunner, parameters: CameraParameters) -> None:
        self._renderer, self._board, self._parameters = renderer, board, parameters

    async def read(self) -> ArrivedPicture:
        """The next picture."""
        await asyncio.sleep(1.0 / min(self._parameters.rate_hz, MOST_HZ))
        pose = self._board.truth(asyncio.get_running_loop().time()).world_from_base
        try:
            jpeg = encode_jpeg(self._renderer.draw(pose, self._board.crowd.discs))
        except ModuleNotFoundError as error:
            raise CameraLost(NO_PILLOW) from error
        return ArrivedPicture(read_picture(jpeg, self._parameters.max_frame_bytes), 0.0)

    async def close(self) -> None:
        """Release nothing."""


def open_simulated(board: BoardRunner | EmbeddedBoard, sim: SimulationParameters) -> OpenSource:
    """What opens a camera that sees the world of this board, whatever source is configured."""
    if isinstance(board, EmbeddedBoard):
        embedded = board

        def capture(parameters: CameraParameters) -> CommandCapture:
            truth = str(embedded.share_truth())
            texts = (truth, sim.model_dump_json(), parameters.model_dump_json())
            return CommandCapture(parameters, (sys.executable, *PROGRAM, *texts))

        return open_threads(capture)
    runner = board

    async def open_source(parameters: CameraParameters) -> PictureSource:
        scene = scene_of(sim.world.map_path, sim.world.closed_doors)
        renderer = PictureRenderer(scene, parameters.mount_x_m, parameters.mount_height_m)
        return SimulatedSource(renderer, runner, parameters)

    return open_source
