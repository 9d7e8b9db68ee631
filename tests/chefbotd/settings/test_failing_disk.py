"""Each write of a configuration fails: what is said is what is on the disk, and no copy of it is lost or left behind."""

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from structlog.testing import capture_logs

from chefbotd.components.calibration import calibrated_file
from chefbotd.components.tuning import gains_file
from chefbotd.settings import load, packaged, replace_file

TUNED = {wheel: own.model_copy(update={"kp": 450.0}) for wheel, own in load().gains().items()}
MEASURED = {"chassis.track_width_m": 0.31}
CHANGES: dict[str, Callable[[Path], object]] = {
    "calibration": lambda path: calibrated_file.save(path, MEASURED),
    "tuning": lambda path: gains_file.save(path, TUNED),
}
NUMBERS = (errno.ENOSPC, errno.EIO, errno.EDQUOT)


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """A copy of ChefBot's configuration."""
    path = tmp_path / "robot.toml"
    path.write_bytes(packaged().read_bytes())
    return path


def failing(number: int) -> Callable[..., Any]:
    """A call that fails so."""

    def fail(*words: Any, **options: Any) -> Any:
        raise OSError(number, os.strerror(number))

    return fail


def half_a_copy(source: Path, target: Path) -> None:
    """The disk is full in the middle of it."""
    Path(target).write_bytes(Path(source).read_bytes()[:100])
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("step", ["fsync", "fchown", "fchmod"])
@pytest.mark.parametrize("change", CHANGES)
def test_a_write_that_fails_changes_nothing_and_leaves_nothing(
    change: str, step: str, number: int, config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file is the old one to the last byte, and is alone in its folder."""
    before = config.read_bytes()
    monkeypatch.setattr(replace_file.os, step, failing(number))  # type: ignore[attr-defined]
    with pytest.raises(OSError, match=os.strerror(number)):
        CHANGES[change](config)
    assert config.read_bytes() == before
    assert list(config.parent.iterdir()) == [config]


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("change", CHANGES)
def test_a_rename_that_fails_changes_nothing(
    change: str, number: int, config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor does it leave a copy."""
    before = config.read_bytes()
    monkeypatch.setattr(Path, "replace", failing(number))
    with pytest.raises(OSError, match=os.strerror(number)):
        CHANGES[change](config)
    assert config.read_bytes() == before
    assert list(config.parent.iterdir()) == [config]


@pytest.mark.parametrize("change", CHANGES)
def test_a_folder_that_cannot_be_synchronized_does_not_make_a_failure_of_what_is_written(
    change: str, config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file is the new one, the old one is kept where it is kept otherwise, and the log says what is not certain."""
    before = config.read_bytes()
    monkeypatch.setattr(replace_file, "sync_folder", failing(errno.EIO))
    with capture_logs() as log:
        CHANGES[change](config)
    assert config.read_bytes() != before
    load(config)
    assert [entry["event"] for entry in log] == ["a power cut may bring the old file back"]
    kept = [path.read_bytes() for path in config.parent.iterdir() if path != config]
    assert kept == ([before] if change == "calibration" else [])


def test_a_copy_that_fails_halfway_is_not_left_behind(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The next one is the first again."""
    before = config.read_bytes()
    monkeypatch.setattr(shutil, "copy2", half_a_copy)
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)):
        calibrated_file.save(config, MEASURED)
    assert config.read_bytes() == before
    assert list(config.parent.iterdir()) == [config]
