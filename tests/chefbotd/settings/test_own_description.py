"""A description of one's own: held against the configuration, refused where it is broken, served as it stands."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs.chefbotd import main
from chefbotd.settings import SettingsError, load
from tests.chefbotd.settings.urdf_files import own, served, written

Command = tuple[str, ...]
OF_THE_SAME_OPINION: list[Command] = [
    ("check-config",),
    ("urdf",),
    ("simulate", "--config"),
    ("run", "--config"),
]


@pytest.mark.parametrize("command", OF_THE_SAME_OPINION, ids=lambda command: command[0])
def test_a_description_of_ones_own_is_held_against_the_configuration(
    tmp_path: Path, command: Command
) -> None:
    """A track that differs is not valid, whatever the command, with both numbers, a line for each of the wheels."""
    path = own(tmp_path, written("khan").read_text(), change=("track_width_m = 0.189", "track_width_m = 0.2"))
    result = CliRunner().invoke(main, [*command, str(path)])
    assert result.exit_code == Exit.BAD_CONFIGURATION
    first, *lines = result.stderr.splitlines()
    assert first.endswith("my.urdf does not describe the robot that is configured:")
    assert lines[0].startswith("front_left_wheel: y is 0.0945 m, expected 0.1 m ")
    assert len(lines) == 4


def test_check_config_tells_scripts_each_difference(tmp_path: Path) -> None:
    """With ``--json`` they are a list."""
    path = own(tmp_path, written("khan").read_text(), change=("mount_x_m = 0.06", "mount_x_m = 0.05"))
    result = CliRunner().invoke(main, ["check-config", "--json", str(path)])
    assert json.loads(result.stderr)["error"]["differences"] == [
        "infrared_joint: x is 0.06 m, expected 0.05 m (infrared.front.mount_x_m)"
    ]


@pytest.mark.parametrize(
    ("urdf", "told"), [(None, "my.urdf: cannot be read: No such file"), ("spoilt", "my.urdf: not a URDF")]
)
def test_a_description_of_ones_own_must_be_there(tmp_path: Path, urdf: str | None, told: str) -> None:
    """One that is missing or broken is told with its path."""
    with pytest.raises(SettingsError, match=told):
        load(own(tmp_path, urdf))


def test_the_daemon_serves_a_description_of_ones_own_as_it_stands(tmp_path: Path) -> None:
    """Byte for byte."""
    text = written("khan").read_text()
    assert served(load(own(tmp_path, text))) == text


def test_a_description_that_is_gone_keeps_nobody_from_driving(tmp_path: Path) -> None:
    """It was there when the configuration was read: null."""
    settings = load(own(tmp_path, written("khan").read_text()))
    (tmp_path / "my.urdf").unlink()
    assert served(settings) is None
