"""The real bindings on a library with OpenNI2's C interface, which is compiled here: what a live camera goes through."""

import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chefbotd.components.depth_camera.link.process import BEARINGS, SCAN, MessageReader
from chefbotd.components.depth_camera.parameters import DepthSourceParameters
from tests.waiting import PATIENCE_S

SOURCE = Path(__file__).parents[4] / "fakes" / "openni2.c"
COMPILER = shutil.which("cc") or ""
bindings = pytest.importorskip("openni._openni2", reason="the extra depth is not installed")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(not COMPILER, reason="there is no C compiler")]

LOOK = """
import sys
from itertools import islice
from chefbotd.clock import SystemClock
from chefbotd.components.depth_camera.link.sources import NoImagesError, frames
from chefbotd.components.depth_camera.parameters import DepthSourceParameters
told = DepthSourceParameters.model_validate_json(sys.argv[1])
try:
    for frame in islice(frames(told, SystemClock().now_s), 5):
        pixels = [frame.depth_mm[0, 0], *frame.depth_mm[-1, [0, 1, -1]]]
        print(*frame.depth_mm.shape, *map(int, pixels), flush=True)
except NoImagesError as problem:
    print(problem)
"""
"""What comes: rows and columns, the image's number, and the last row's first, second and last pixel."""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the library; what it does not have of the functions that the bindings look for does nothing."""
    folder, source = tmp_path_factory.mktemp("openni"), SOURCE.read_text()
    wanted = set(re.findall(r"dll\.(oni\w+)", Path(bindings.__file__).read_text()))
    missing = sorted(name for name in wanted if f" {name}(" not in source and f"*{name}(" not in source)
    (folder / "all.c").write_text(source + "".join(f"int {name}(void) {{ return 2; }}\n" for name in missing))
    compile_it = [COMPILER, "-shared", "-fPIC", "-w", "-o", "libOpenNI2.so", "all.c"]
    subprocess.run(compile_it, cwd=folder, check=True)
    return folder


def camera(library: Path, **told: Any) -> str:
    """A camera's parameters."""
    return DepthSourceParameters.model_validate({"library": library, "rate_hz": 60, **told}).model_dump_json()


def looked(library: Path, fault: str = "", **told: Any) -> list[str]:
    """What the source gives, a line an image, or why it gives none; the process has its own library."""
    run = subprocess.run(
        [sys.executable, "-c", LOOK, camera(library, **told)],
        capture_output=True, text=True, timeout=PATIENCE_S, check=True, env={"FAKE_ONI": fault},
    )  # fmt: skip
    return run.stdout.splitlines()


def test_images_have_the_configured_size_and_are_not_mirrored(library: Path) -> None:
    """The camera begins with 320 by 240 pixels and left for right; ours are 640 by 480, and the left column is 0."""
    lines = looked(library, device="1d27/0601@1/4")
    assert len(lines) == 5
    assert lines[0] == "480 640 1 0 1 639"


def test_another_size_is_asked_for_too(library: Path) -> None:
    """Half of it."""
    told = {"width": 320, "height": 240, "center_x_px": 160, "center_y_px": 120}
    assert looked(library, **told)[0] == "240 320 1 0 1 319"


@pytest.mark.parametrize(
    ("fault", "told", "said"),
    [
        ("none", {}, "no depth camera can be opened: .*no devices found"),
        ("", {"device": "1d27/0601@2/9"}, "no depth camera can be opened: .*no such device"),
        ("coarse", {}, "no depth images of 640 by 480 pixels as configured; it has: 320 by 240$"),
        ("pulled", {}, "the camera gives no more images: .*the device was disconnected"),
    ],
)
def test_what_is_wrong_is_said(library: Path, fault: str, told: dict[str, str], said: str) -> None:
    """By the library's own words, in one line, after the images that did come."""
    lines = looked(library, fault, **told)
    assert re.search(said, lines[-1])
    assert len(lines) == (4 if fault == "pulled" else 1)


def test_the_cameras_process_gives_scans_of_it_and_one_that_hangs_is_killed(library: Path) -> None:
    """The whole process of a camera; hanging in the library's read it writes nothing, and dies when it is killed."""
    program = [
        sys.executable,
        "-P",
        "-m",
        "chefbotd.components.depth_camera.link",
        camera(library, mount_pitch_rad=0.1),
    ]
    pipes: dict[str, Any] = {
        "stdin": subprocess.PIPE,
        "stdout": subprocess.PIPE,
        "stderr": subprocess.DEVNULL,
    }
    with subprocess.Popen(program, env={}, **pipes) as process:
        assert process.stdout is not None
        reader, kinds = MessageReader(), []
        while len(kinds) < 4:
            for message in reader.feed_bytes(process.stdout.read1(65_536)):
                kinds.append(message.kind)
                assert len(message.values) == 320
                assert np.isfinite(message.values).all()
        process.stdin.close()  # type: ignore[union-attr]
        assert process.wait(PATIENCE_S) == 0
    assert kinds[:4] == [BEARINGS, SCAN, SCAN, SCAN]
    with subprocess.Popen(program, env={"FAKE_ONI": "hang"}, **pipes) as process:
        time.sleep(1.0)
        assert process.poll() is None
        process.stdin.close()  # type: ignore[union-attr]
        assert process.wait(PATIENCE_S) == 0  # the daemon's end is heard though the library hangs
