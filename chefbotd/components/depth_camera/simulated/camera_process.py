"""The process of one simulated depth camera: ``python -m MODULE TRUTH SIM CAMERA``.

It draws what the camera would see from where the robot truly is, and sends it as the real one's process does.
"""

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from chefbotd.clock import SystemClock
from chefbotd.components.depth_camera.link.child import run
from chefbotd.components.depth_camera.link.sources import Frame
from chefbotd.components.depth_camera.parameters import DepthSourceParameters
from chefbotd.components.depth_camera.simulated.depth_image import DepthRenderer
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.rooms import scene_of
from chefbotd.components.simulation.truth_file import TruthReader

RETRY_S = 0.001


def images(truth: Path, sim: SimulationParameters, parameters: DepthSourceParameters) -> Iterator[Frame]:
    """Send what the camera sees, at its rate, for ever."""
    scene = scene_of(sim.world.map_path, sim.world.closed_doors)
    renderer, reader = DepthRenderer(parameters, scene), TruthReader(truth)
    chance, clock = np.random.default_rng(sim.seed), SystemClock()
    due_s = clock.now_s()
    while True:
        time.sleep(max(due_s - clock.now_s(), 0.0))
        now = reader.read()
        if now is None:
            time.sleep(RETRY_S)
            continue
        yield Frame(now.stamp_s, renderer.image(now.world_from_base, now.discs, chance))
        due_s = max(due_s + 1 / parameters.rate_hz, clock.now_s())


def main(arguments: list[str]) -> int:
    """The process; its arguments are the truth's path, and simulation and camera as JSON."""
    truth, sim, camera = arguments
    parameters = DepthSourceParameters.model_validate_json(camera)
    return run(parameters, images(Path(truth), SimulationParameters.model_validate_json(sim), parameters))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
