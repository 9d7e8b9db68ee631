"""The commands about gains that touch a file."""

import json
from pathlib import Path

import pytest

from chefbotd.cli.common.exits import Exit
from chefbotd.components.tuning import gains_file
from chefbotd.settings import load
from tests.chefbotd.conftest import Control
from tests.robot_files import full


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """A copy of ChefBot's configuration."""
    path = tmp_path / "robot.toml"
    path.write_bytes(full().read_bytes())
    return path


def test_save_writes_the_gains_in_force(control: Control, config: Path) -> None:
    """The daemon's gains go to the file, which then loads with them."""
    result = control("--json", "pid", "save", str(config))
    assert json.loads(result.stdout) == {"saved": str(config)}
    assert (load(config).pid.kv, load(config).pid.kp) == (0.0, 400.0)  # the fake daemon's


def test_save_to_what_is_no_configuration(control: Control, config: Path) -> None:
    """The file stays, and the exit code says that it is the configuration's fault."""
    config.write_text("[pid]\n")
    assert control("pid", "save", str(config)).exit_code == Exit.BAD_CONFIGURATION
    assert config.read_text() == "[pid]\n"


def test_save_where_it_may_not(control: Control, config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the system refuses is told in its words."""

    def refuse(path: Path, gains: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(gains_file, "save", refuse)
    result = control("pid", "save", str(config))
    assert result.exit_code == Exit.FAILED
    assert f"{config} was not written: Permission denied" in result.stderr


@pytest.mark.parametrize("args", [["save", "/no/such/file.toml"], ["tune", "--amplitude", "0.5"], ["save"]])
def test_wrong_arguments(control: Control, args: list[str]) -> None:
    """A file that is not there and an amplitude that is not safe are usage errors."""
    assert control("pid", *args).exit_code == Exit.USAGE
