"""The sources of depth images. All of this blocks, so it runs in its own process."""

import ctypes.util
import itertools
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from chefbotd.components.depth_camera.parameters import DepthSource, DepthSourceParameters
from chefbotd.core.record import Record
from chefbotd.extras import how_to_add_extra

DepthImage: TypeAlias = npt.NDArray[np.uint16]
Sleep: TypeAlias = Callable[[float], None]
Now: TypeAlias = Callable[[], float]

MISSING = f"OpenNI2's bindings are not installed: {how_to_add_extra('depth')}"
NO_PILLOW = f"Pillow, which reads images, is not installed: {how_to_add_extra('depth')}"


class Frame(Record, frozen=True):
    """A depth image in millimetres, and when it came."""

    stamp_s: float
    depth_mm: DepthImage


class NoImagesError(Exception):
    """A source that gives no images; its text is ready to be shown."""


def frames(parameters: DepthSourceParameters, now: Now, sleep: Sleep = time.sleep) -> Iterator[Frame]:
    """The images of the configured source, for ever.

    Raises:
        NoImagesError: there are none, and why.
    """
    if parameters.source is DepthSource.FOLDER:
        return folder_frames(parameters, now, sleep)
    return openni2_frames(parameters, now)


def folder_frames(parameters: DepthSourceParameters, now: Now, sleep: Sleep) -> Iterator[Frame]:
    """The folder's images in the order of their names, again and again, at the configured rate.

    Raises:
        NoImagesError: there is no such image, or one of them is none, or of another size.
    """
    folder = parameters.folder
    assert folder is not None  # noqa: S101 - the parameters see to it
    paths = sorted(folder.glob(parameters.pattern))
    if not paths:
        raise NoImagesError(f"{folder}: there is no file {parameters.pattern}")
    due_s = now()
    for path in itertools.cycle(paths):
        image = _read_image(path, parameters)
        sleep(max(due_s - now(), 0.0))
        yield Frame(now(), image)
        due_s = max(due_s + 1 / parameters.rate_hz, now())


def _read_image(path: Path, parameters: DepthSourceParameters) -> DepthImage:
    try:
        from PIL import Image, UnidentifiedImageError  # for this source only
    except ImportError as error:
        raise NoImagesError(NO_PILLOW) from error
    try:
        with Image.open(path) as image:
            if not image.mode.startswith("I"):
                raise NoImagesError(f"{path}: expected an image of 16 bits, got mode {image.mode}")
            raw = np.asarray(image, np.uint32)
    except (UnidentifiedImageError, OSError) as error:
        raise NoImagesError(f"{path}: cannot be read as an image: {error}") from error
    return _in_millimetres(raw, parameters, str(path))


def _in_millimetres(raw: npt.NDArray[Any], parameters: DepthSourceParameters, what: str) -> DepthImage:
    """Raises ``NoImagesError`` unless the image has the configured size."""
    if raw.shape != (parameters.height, parameters.width):
        rows, columns = raw.shape
        size = f"{parameters.width} by {parameters.height}"
        raise NoImagesError(f"{what}: expected {size} pixels as configured, got {columns} by {rows}")
    if parameters.millimetres_per_unit != 1:
        raw = np.rint(raw * parameters.millimetres_per_unit)
    depth_mm: DepthImage = np.minimum(raw, 65_535).astype(np.uint16)
    return depth_mm


def openni2_frames(parameters: DepthSourceParameters, now: Now) -> Iterator[Frame]:
    """A camera's images, at the configured rate at most. The camera's library may block for ever.

    Raises:
        NoImagesError: the bindings, the library or the camera is not there.
    """
    try:
        from openni import _openni2 as c_api
        from openni import openni2
    except ImportError as error:
        raise NoImagesError(MISSING) from error
    _load_library(openni2, c_api, parameters.library)
    stream = _open_stream(openni2, parameters)
    due_s = now()
    while True:
        try:
            frame = stream.read_frame()
        except openni2.OpenNIError as error:
            raise NoImagesError(f"the camera gives no more images: {_error_text(error)}") from error
        stamp_s = now()
        if stamp_s < due_s:
            continue
        due_s = max(due_s + 1 / parameters.rate_hz, stamp_s)
        raw = np.frombuffer(frame.get_buffer_as_uint16(), np.uint16).reshape(frame.height, frame.width)
        yield Frame(stamp_s, _in_millimetres(raw, parameters, "the camera's image"))


def _open_stream(openni2: Any, parameters: DepthSourceParameters) -> Any:
    device = parameters.device
    try:
        opened = openni2.Device.open_any() if device is None else openni2.Device(device.encode())
        stream = opened.create_depth_stream()
        if stream is None:
            raise NoImagesError("the device has no depth camera")
        stream.set_video_mode(_video_mode(openni2, stream.get_sensor_info().videoModes, parameters))
        stream.set_mirroring_enabled(False)  # a camera may begin with left for right, as a mirror (assumed)
        stream.start()
    except openni2.OpenNIError as error:
        raise NoImagesError(f"no depth camera can be opened: {_error_text(error)}") from error
    return stream


def _video_mode(openni2: Any, offered: list[Any], parameters: DepthSourceParameters) -> Any:
    """Images of the configured size in millimetres, at the lowest rate that suffices."""
    size = (parameters.width, parameters.height)
    millimetres = [mode for mode in offered if mode.pixelFormat == openni2.PIXEL_FORMAT_DEPTH_1_MM]
    fitting = [mode for mode in millimetres if (mode.resolutionX, mode.resolutionY) == size]
    if not fitting:
        sizes = sorted({(mode.resolutionX, mode.resolutionY) for mode in millimetres})
        offered_sizes = ", ".join(f"{width} by {height}" for width, height in sizes) or "none"
        raise NoImagesError(
            f"the camera has no depth images of {size[0]} by {size[1]} pixels as configured; it has: {offered_sizes}"
        )
    return min(fitting, key=lambda mode: (mode.fps < parameters.rate_hz, abs(mode.fps - parameters.rate_hz)))


def _load_library(openni2: Any, c_api: Any, folder: Path | None) -> None:
    """From the configured folder, from where the bindings look, or from where the system's loader finds it.

    The bindings know ``libOpenNI2.so`` alone, Debian's package without its development files ``libOpenNI2.so.0``.
    """
    try:
        if folder is not None:
            openni2.initialize(str(folder))
            return
        try:
            openni2.initialize()
        except openni2.InitializationError:
            if (library := ctypes.util.find_library("OpenNI2")) is None:
                raise
            c_api.load_dll(library)
            openni2.loaded_dll_directory = library
            openni2.initialize()
    except (openni2.InitializationError, openni2.OpenNIError) as error:
        raise NoImagesError(
            f"OpenNI2 cannot be loaded (Debian: libopenni2-0): {_error_text(error)}"
        ) from error


def _error_text(error: Exception) -> str:
    parts = error.args[0] if error.args and isinstance(error.args[0], tuple) else error.args
    texts = [
        part.decode(errors="replace") if isinstance(part, bytes) else str(part) for part in parts if part
    ]
    return " ".join(" ".join(texts).split())
