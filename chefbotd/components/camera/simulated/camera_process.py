"""The process of a simulated camera: ``python -m MODULE TRUTH SIM CAMERA``.

It draws what the camera would see from where the robot truly is, and writes Motion JPEG as a real one's program does.
"""

import os
import sys
import time
from pathlib import Path

from chefbotd.components.camera.parameters import CameraParameters
from chefbotd.components.camera.simulated.picture import PictureRenderer, encode_jpeg
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.rooms import scene_of
from chefbotd.components.simulation.truth_file import TruthReader

MOST_HZ = 8.0
"""Drawing a picture takes some 20 ms; the simulation needs the processor, too."""
NO_PILLOW = "drawing its pictures needs Pillow: pip install 'chefbotd[camera]'"


def main(arguments: list[str]) -> int:
    """The process; its arguments are the truth's path, and simulation and camera as JSON."""
    truth, sim_text, camera_text = arguments
    sim = SimulationParameters.model_validate_json(sim_text)
    camera = CameraParameters.model_validate_json(camera_text)
    renderer = PictureRenderer(
        scene_of(sim.world.map_path, sim.world.closed_doors), camera.mount_x_m, camera.mount_height_m
    )
    reader, period_s = TruthReader(Path(truth)), 1.0 / min(camera.rate_hz, MOST_HZ)
    due_s = time.monotonic()
    with os.fdopen(1, "wb", buffering=0, closefd=False) as output:
        while True:
            time.sleep(max(due_s - time.monotonic(), 0.0))
            due_s = max(due_s + period_s, time.monotonic())
            now = reader.read()
            if now is None:
                continue
            try:
                output.write(encode_jpeg(renderer.draw(now.world_from_base, now.discs)))
            except BrokenPipeError:  # the daemon has ended
                return os.EX_OK
            except ModuleNotFoundError:
                sys.stderr.write(f"{NO_PILLOW}\n")
                return os.EX_UNAVAILABLE


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
