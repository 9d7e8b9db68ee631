"""What a depth image of 640 by 480 pixels costs on its way to a scan.

The image is made up: a floor, a wall and boxes with holes, as a mount with pitch and roll sees them. Its content changes
nothing about the cost, as every pixel is looked at whatever it says. Time is the thread's processor time.
"""

import statistics
import time

import numpy as np
import numpy.typing as npt

from benchmarks.figures import Figure, Outcome
from chefbotd.components.depth_camera.algorithms.depth_scan import DepthCameraParameters, DepthToScan

IMAGES = 300
CAMERA = DepthCameraParameters(mount_pitch_rad=0.2, mount_roll_rad=0.03)
HOLES = 0.15


def run(*, quick: bool = False) -> Outcome:
    """The median and the 95th percentile over a few hundred conversions."""
    converter, image = DepthToScan(CAMERA), _image()
    took_ms = []
    for _ in range(IMAGES // 6 if quick else IMAGES):
        began_s = time.thread_time()
        converter.scan(image)
        took_ms.append((time.thread_time() - began_s) * 1e3)
    began_s = time.thread_time()
    DepthToScan(CAMERA)
    once_ms = (time.thread_time() - began_s) * 1e3
    return Outcome(
        (
            Figure("depth image to scan, median", statistics.median(took_ms), "ms", 3.0),
            Figure("depth image to scan, p95", statistics.quantiles(took_ms, n=20)[-1], "ms"),
            Figure("once for each camera", once_ms, "ms"),
        )
    )


def _image() -> npt.NDArray[np.uint16]:
    """A floor that comes nearer downwards, a wall above it, a box, and holes."""
    rows = np.arange(CAMERA.height)[:, np.newaxis]
    down = (rows - CAMERA.center_y_px) / CAMERA.focal_y_px + CAMERA.mount_pitch_rad
    floor_m = np.where(down > 0.1, CAMERA.mount_height_m / np.maximum(down, 0.1), 3.5)
    depth_m = np.broadcast_to(floor_m, (CAMERA.height, CAMERA.width)).copy()
    depth_m[200:400, 250:400] = 1.2
    chance = np.random.default_rng(1)
    depth_m[chance.random(depth_m.shape) < HOLES] = 0.0
    return (depth_m * 1000).astype(np.uint16)
