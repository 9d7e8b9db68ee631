"""The process of one depth camera: images in, scans out. It ends with the daemon, however that ends."""

import os
import sys
import threading
from collections.abc import Iterable

import numpy as np

from chefbotd.clock import SystemClock
from chefbotd.components.depth_camera.algorithms.depth_scan import DepthToScan
from chefbotd.components.depth_camera.link.process import BEARINGS, SCAN, encode
from chefbotd.components.depth_camera.link.sources import Frame, NoImagesError, frames
from chefbotd.components.depth_camera.parameters import DepthCameraParameters, DepthSourceParameters


class ScanWriter:
    """The messages for one camera's images: the bearings first, then a scan for each, 0 where nothing is seen."""

    def __init__(self, parameters: DepthCameraParameters) -> None:
        self._converter = DepthToScan(parameters)
        self._is_first = True

    def encode_scan(self, frame: Frame) -> bytes:
        """What an image is told as."""
        scan = self._converter.scan(frame.depth_mm)
        bearings = encode(BEARINGS, 0.0, scan.bearing_rad) if self._is_first else b""
        self._is_first = False
        return bearings + encode(SCAN, frame.stamp_s, np.where(np.isfinite(scan.range_m), scan.range_m, 0.0))


def run(parameters: DepthCameraParameters, images: Iterable[Frame]) -> int:
    """Serve on stdout until the daemon is gone; what a library prints there goes to stderr. The exit code."""
    with os.fdopen(os.dup(1), "wb", buffering=0) as out:
        os.dup2(2, 1)
        threading.Thread(target=_end_with_daemon, daemon=True).start()
        try:
            writer = ScanWriter(parameters)
            for frame in images:
                out.write(writer.encode_scan(frame))
        except NoImagesError as error:
            sys.stderr.write(f"{error}\n")
            return os.EX_UNAVAILABLE
        except BrokenPipeError:
            return os.EX_OK
    return os.EX_OK


def _end_with_daemon() -> None:
    """The daemon holds stdin open as long as it lives; this thread sees its end though a library hangs.

    Reads descriptor 0 itself: a buffered reader's lock, held here at exit, would abort the interpreter.
    """
    while os.read(0, 4096):
        pass
    os._exit(os.EX_OK)


def main(arguments: list[str]) -> int:
    """The process; its argument are the parameters as JSON."""
    parameters = DepthSourceParameters.model_validate_json(arguments[0])
    return run(parameters, frames(parameters, SystemClock().now_s))
