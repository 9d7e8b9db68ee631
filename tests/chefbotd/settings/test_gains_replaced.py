"""How a configuration is replaced by one with other gains, and when it is not."""

import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import tomlkit

from chefbotd.components.tuning.gains_file import save
from chefbotd.settings import SettingsError, load, packaged, replace_file
from tests.robot_files import full

NOBODY = 65534
PACKAGED = full().read_bytes()
"""ChefBot's configuration; read before anybody gives up the right to look into the folder of the sources."""

TUNED = {wheel: own.model_copy(update={"kp": 450.0}) for wheel, own in load().gains().items()}
"""Other gains for both of ChefBot's wheels."""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """A copy of ChefBot's configuration."""
    path = tmp_path / "robot.toml"
    path.write_bytes(full().read_bytes())
    return path


def test_the_file_is_replaced_as_it_was(config: Path) -> None:
    """Mode and line ends stay, a symbolic link goes on pointing at the file, and nothing is left lying about."""
    config.write_bytes(config.read_bytes().replace(b"\n", b"\r\n"))
    config.chmod(0o640)
    link = config.with_name("link.toml")
    link.symlink_to(config.name)
    save(link, TUNED)
    assert stat.S_IMODE(config.stat().st_mode) == 0o640
    assert b"output_limit_duty = 255.0\r\n" in config.read_bytes()
    assert b"\nkp_duty_per_m_s = 450.0 " in config.read_bytes()
    assert link.is_symlink()
    assert sorted(path.name for path in config.parent.iterdir()) == ["link.toml", "robot.toml"]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may give files away")
def test_the_owner_is_kept(config: Path) -> None:
    """What root saves stays the file of the user who had it."""
    os.chown(config, 1234, 4321)
    save(config, TUNED)
    assert (config.stat().st_uid, config.stat().st_gid) == (1234, 4321)


def test_another_robots_file(config: Path) -> None:
    """Gains of wheels that the file does not have are not written into it."""
    before = config.read_bytes()
    with pytest.raises(
        SettingsError, match="for the wheels left_wheel, right_wheel; the gains are for third"
    ):
        save(config, {"third": TUNED["left_wheel"]})
    assert config.read_bytes() == before


def test_no_configuration(config: Path) -> None:
    """What was broken before is not touched."""
    config.write_text("[pid]\n")
    with pytest.raises(SettingsError, match="this key is required"):
        save(config, TUNED)
    assert config.read_text() == "[pid]\n"


def test_a_file_that_would_not_load(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Should the new file be refused, the old one stays and the new one is gone."""
    before = config.read_bytes()

    def only_the_old(path: Path) -> object:
        if path.name != config.name:
            raise SettingsError("it is refused")
        return load(path)

    monkeypatch.setattr(replace_file, "load", only_the_old)
    with pytest.raises(SettingsError, match="it is refused"):
        save(config, TUNED)
    assert config.read_bytes() == before
    assert [path.name for path in config.parent.iterdir()] == ["robot.toml"]


def test_an_editor_that_errs(config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Should the file come out of editing with another meaning, it is not written."""
    before = config.read_bytes()
    dumps = tomlkit.dumps
    monkeypatch.setattr(tomlkit, "dumps", lambda document: dumps(document).replace("baud = 1", "baud = 2"))
    with pytest.raises(SettingsError, match=r"robot\.toml: cannot be edited"):
        save(config, TUNED)
    assert config.read_bytes() == before


def test_line_ends_of_long_ago(config: Path) -> None:
    """A carriage return alone ends no line in TOML: it is not taken for one, and not written over."""
    config.write_bytes(before := config.read_bytes().replace(b"\n", b"\r"))
    with pytest.raises(SettingsError, match=r"robot\.toml: not valid TOML: Found invalid character '\\r'"):
        save(config, TUNED)
    assert config.read_bytes() == before


@pytest.fixture
def readable_only() -> Iterator[Path]:
    """ChefBot's configuration, of which file and folder may only be read, also if it is root who runs the tests."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        config, was = folder / packaged().name, os.geteuid()
        config.write_bytes(PACKAGED)
        config.chmod(0o444)
        folder.chmod(0o555)
        if was == 0:
            os.seteuid(NOBODY)
        yield config
        os.seteuid(was)
        folder.chmod(0o755)


def test_a_file_that_may_only_be_read(readable_only: Path) -> None:
    """It is refused with its name, and stays."""
    with pytest.raises(PermissionError, match=rf"Permission denied: '{readable_only}'"):
        save(readable_only, TUNED)
    assert readable_only.read_bytes() == PACKAGED


def test_a_folder_that_may_only_be_read(readable_only: Path) -> None:
    """A file that could be written is refused as well, because it could not be replaced in one step."""
    mine = os.geteuid()
    os.seteuid(os.getuid())
    readable_only.chmod(0o666)
    os.seteuid(mine)
    with pytest.raises(
        PermissionError, match=rf"cannot create a file in its folder: Permission denied: '{readable_only}'"
    ):
        save(readable_only, TUNED)
    assert readable_only.read_bytes() == PACKAGED
    assert list(readable_only.parent.iterdir()) == [readable_only]


def test_a_file_that_begins_with_a_byte_order_mark(config: Path) -> None:
    """It is edited like any other, and has none any more."""
    save(config, TUNED)
    edited = config.read_bytes()
    config.write_bytes(b"\xef\xbb\xbf" + full().read_bytes())
    save(config, TUNED)
    assert config.read_bytes() == edited
