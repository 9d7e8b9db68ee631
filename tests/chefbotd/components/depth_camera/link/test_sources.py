"""Depth images from a folder, and from a camera's library that is made up here."""

import sys
import types
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from pydantic import ValidationError

from chefbotd.components.depth_camera.link.sources import NoImagesError, frames
from chefbotd.components.depth_camera.parameters import DepthSourceParameters
from tests.missing import PILLOW, hide

SMALL = {"width": 4, "height": 2, "center_x_px": 2, "center_y_px": 1}


class Time:
    """A clock that goes on by what is slept, and by a little for each look."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def now(self) -> float:
        """The time."""
        return self.now_s

    def sleep(self, seconds: float) -> None:
        """Let it pass."""
        self.now_s += seconds


def parameters(**values: Any) -> DepthSourceParameters:
    """A camera of 4 by 2 pixels."""
    return DepthSourceParameters.model_validate({**SMALL, **values})


def write(path: Path, values: list[list[int]]) -> None:
    """A PNG of 16 bits."""
    Image.fromarray(np.array(values, np.uint16)).save(path)


def test_a_folder_is_played_in_order_again_and_again_at_its_rate(tmp_path: Path) -> None:
    """Two of three files match; 5 Hz; units of 2 mm."""
    write(tmp_path / "b.depth.png", [[500, 0, 3, 4], [5, 6, 7, 8]])
    write(tmp_path / "a.depth.png", [[1000, 2, 3, 4], [5, 6, 7, 60_000]])
    write(tmp_path / "a.color.png", [[9, 9, 9, 9], [9, 9, 9, 9]])
    told = {"source": "folder", "folder": tmp_path, "pattern": "*.depth.png"}
    time = Time()
    images = frames(parameters(**told, rate_hz=5, millimetres_per_unit=2), time.now, time.sleep)
    seen = list(islice(images, 5))
    assert [frame.depth_mm[0, 0] for frame in seen] == [2000, 1000, 2000, 1000, 2000]
    assert [round(frame.stamp_s - 100, 6) for frame in seen] == [0.0, 0.2, 0.4, 0.6, 0.8]
    assert seen[0].depth_mm[1, 3] == 65_535  # as far as a millimetre of 16 bits goes
    assert seen[0].depth_mm.dtype == np.uint16


def test_images_need_pillow_and_that_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the extra is not installed, with the command of pip."""
    write(tmp_path / "a.png", [[1000, 2, 3, 4], [5, 6, 7, 8]])
    hide(monkeypatch, *PILLOW)
    with pytest.raises(NoImagesError, match=r"Pillow.*pip install 'chefbotd\[depth\]'"):
        next(frames(parameters(source="folder", folder=tmp_path), lambda: 0.0, lambda _: None))


def test_what_gives_no_images_says_why(tmp_path: Path) -> None:
    """No file, an image of 8 bits, one of another size, and no image at all."""
    told = {"source": "folder", "folder": tmp_path}

    def problem() -> str:
        with pytest.raises(NoImagesError) as refused:
            next(frames(parameters(**told), Time().now))
        return str(refused.value)

    assert problem() == f"{tmp_path}: there is no file *.png"
    Image.fromarray(np.zeros((2, 4), np.uint8)).save(tmp_path / "a.png")
    assert "expected an image of 16 bits, got mode L" in problem()
    write(tmp_path / "a.png", [[1, 2, 3]])
    assert "expected 4 by 2 pixels as configured, got 3 by 1" in problem()
    (tmp_path / "a.png").write_text("hello")
    assert "cannot be read as an image" in problem()


@pytest.mark.parametrize(
    ("values", "told"),
    [({"source": "folder"}, "needs a folder"), ({"folder": "/tmp"}, "'openni2' has no folder")],
)
def test_a_folder_belongs_to_its_source(values: dict[str, str], told: str) -> None:
    """One without the other is refused."""
    with pytest.raises(ValidationError, match=told):
        parameters(**values)


class FakeOpenNi2:
    """The bindings' modules, as far as they are used: a camera of 4 by 2 pixels and 30 Hz, or none."""

    def __init__(self, time: Time, *, library: bool = True, camera: bool = True) -> None:
        self.opened: list[bytes | None] = []
        self.loaded: list[str | None] = []
        self._time, self._library, self._camera = time, library, camera
        self.width, self.height = 4, 2
        self.videoModes = [
            types.SimpleNamespace(pixelFormat=100, resolutionX=4, resolutionY=2, fps=fps) for fps in (15, 30)
        ]
        self.timestamp = 0

    def install(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Put the modules where they are imported from."""
        package, api, c_api = (types.ModuleType(name) for name in ("openni", "openni.openni2", "_openni2"))
        api.OpenNIError = type("OpenNIError", (Exception,), {})  # type: ignore[attr-defined]
        api.PIXEL_FORMAT_DEPTH_1_MM = 100  # type: ignore[attr-defined]
        api.InitializationError = type("InitializationError", (Exception,), {})  # type: ignore[attr-defined]
        api.Device = self._device(api)  # type: ignore[attr-defined]
        api.initialize = self._initialize(api)  # type: ignore[attr-defined]
        package.openni2, package._openni2 = api, c_api  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, "openni", package)
        monkeypatch.setitem(sys.modules, "openni.openni2", api)

    def _initialize(self, api: Any) -> Any:
        def initialize(folder: str | None = None) -> None:
            self.loaded.append(folder)
            if not self._library:
                raise api.InitializationError("OpenNI2 could not be loaded:\n    no file")

        return initialize

    def _device(self, api: Any) -> Any:
        fake = self

        class Device:
            def __init__(self, uri: bytes | None) -> None:
                fake.opened.append(uri)
                if not fake._camera:
                    raise api.OpenNIError("ONI_STATUS_ERROR", b"no devices found", None)

            @classmethod
            def open_any(cls) -> "Device":
                return cls(None)

            def create_depth_stream(self) -> FakeOpenNi2:
                return fake

        return Device

    def get_sensor_info(self) -> "FakeOpenNi2":
        """What images it has."""
        return self

    def set_video_mode(self, mode: Any) -> None:
        """Take one of them."""
        assert mode in self.videoModes

    def set_mirroring_enabled(self, enabled: bool) -> None:
        """Whether left and right are exchanged."""
        assert not enabled

    def start(self) -> None:
        """The stream begins."""

    def read_frame(self) -> "FakeOpenNi2":
        """Wait for the next image."""
        self._time.now_s += 1 / 30
        self.timestamp += 1
        return self

    def get_buffer_as_uint16(self) -> bytes:
        """Its pixels: the image's number first."""
        return np.array([self.timestamp, 2, 3, 4, 5, 6, 7, 8], np.uint16).tobytes()


def test_a_cameras_images_come_at_the_rate_that_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """30 images a second of which 10 are used; the device by its URI, the library by its folder."""
    time = Time()
    fake = FakeOpenNi2(time)
    fake.install(monkeypatch)
    images = frames(parameters(device="usb:1", library="/opt/openni", rate_hz=10), time.now)
    seen = list(islice(images, 4))
    assert [frame.depth_mm[0, 0] for frame in seen] == [1, 3, 6, 9]
    assert (fake.opened, fake.loaded) == ([b"usb:1"], ["/opt/openni"])
    assert seen[3].stamp_s - seen[2].stamp_s == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("fake", "told"),
    [
        ({"library": False}, r"OpenNI2 cannot be loaded \(Debian: libopenni2-0\): OpenNI2 could not"),
        ({"camera": False}, "no depth camera can be opened: ONI_STATUS_ERROR no devices found"),
    ],
)
def test_a_camera_that_is_not_there_is_told(
    fake: dict[str, bool], told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is missing, and what the library says of it."""
    FakeOpenNi2(Time(), **fake).install(monkeypatch)
    monkeypatch.setattr("ctypes.util.find_library", lambda _: None)
    with pytest.raises(NoImagesError, match=told):
        next(frames(parameters(), Time().now))


def test_without_the_extra_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """No bindings: how to get them."""
    monkeypatch.setitem(sys.modules, "openni", None)
    with pytest.raises(NoImagesError, match=r"pip install 'chefbotd\[depth\]'"):
        next(frames(parameters(), Time().now))
