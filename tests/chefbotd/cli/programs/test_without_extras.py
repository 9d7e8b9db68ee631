"""chefbotd where neither Pillow (extra maps) nor urdf-parser-py (extra urdf) is installed."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs.chefbotd import main
from chefbotd.settings import MissingExtraError, load
from tests.budget import sample
from tests.missing import PILLOW, URDF_PARSER, hide
from tests.robot_files import full
from tests.waiting import PATIENCE_S

URDF_ADVICE = "pip install 'chefbotd[urdf]'"
ROBOTS = ["chefbot", "khan", "chefbot_lidar"]


@pytest.fixture(autouse=True)
def _slim(monkeypatch: pytest.MonkeyPatch) -> None:
    hide(monkeypatch, *PILLOW, *URDF_PARSER)


def chefbotd(*args: str | Path) -> Result:
    """Run a command to its end."""
    return CliRunner().invoke(main, [str(arg) for arg in args])


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A robot with a description of its own."""
    assert chefbotd("init", "--robot", "khan", tmp_path).exit_code == 0
    path = tmp_path / "khan.toml"
    (tmp_path / "khan.urdf").write_text(chefbotd("urdf", "khan").output, encoding="utf-8")
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("[robot]\n", '[robot]\ndescription = "khan.urdf"\n'), encoding="utf-8")
    return path


@pytest.mark.parametrize("robot", ROBOTS)
def test_packaged_robots_are_valid_copied_and_described(tmp_path: Path, robot: str) -> None:
    """The URDF is made from the configuration, which needs no parser."""
    assert chefbotd("check-config", robot).exit_code == 0
    assert chefbotd("init", "--robot", robot, tmp_path).exit_code == 0
    assert chefbotd("urdf", tmp_path / f"{robot}.toml").output == chefbotd("urdf", robot).output
    assert chefbotd("check-config", tmp_path / f"{robot}.toml").exit_code == 0


@pytest.mark.parametrize(
    "command",
    [
        ("check-config",),
        ("urdf",),
        ("run", "--config"),
        ("run", "--sim", "--config"),
        ("install-service", "--dry-run", "--root", ".", "--program", "/opt/chefbotd", "--config"),
    ],
)
def test_a_description_of_ones_own_is_refused_with_what_to_install(
    own: Path, command: tuple[str, ...]
) -> None:
    """It was never held against the robot: exit code 7, one line with the key, the file and the command of pip."""
    result = chefbotd(*command, own)
    assert result.exit_code == Exit.NOT_INSTALLED
    (told,) = result.stderr.splitlines()
    assert told.startswith(f"Error: robot.description: {own.parent / 'khan.urdf'}: urdf-parser-py")
    assert URDF_ADVICE in told


def test_scripts_get_the_same_as_json(own: Path) -> None:
    """With the exit code."""
    told = json.loads(chefbotd("check-config", "--json", own).stderr)["error"]
    assert told["exit_code"] == 7
    assert URDF_ADVICE in told["message"]


def test_whoever_loads_settings_gets_it_as_any_other_error_of_them(own: Path) -> None:
    """So a reload that meets it changes nothing, and the daemon goes on."""
    with pytest.raises(MissingExtraError, match=r"chefbotd\[urdf\]"):
        load(own)


@pytest.fixture
def in_a_map(tmp_path: Path) -> Path:
    """ChefBot in a world that is a map: 3 by 2 m with a wall along its left edge."""
    rows = b"\0" + b"\xfe" * 29
    (tmp_path / "hall.pgm").write_bytes(b"P5\n30 20\n255\n" + rows * 20)
    (tmp_path / "hall.yaml").write_text(
        "image: hall.pgm\nresolution: 0.1\norigin: [-1.0, -0.7, 0]\nnegate: 0\n", encoding="utf-8"
    )
    path = tmp_path / "hall.toml"
    world = f'\n[sim]\nworld = "{tmp_path / "hall.yaml"}"\n'
    text = full().read_text(encoding="utf-8")
    assert "\n[sim]\n" not in text
    path.write_text(text + world, encoding="utf-8")
    return path


@pytest.mark.parametrize("command", [("run", "--sim", "--config"), ("simulate", "--config")])
def test_a_world_that_is_a_map_needs_pillow(in_a_map: Path, command: tuple[str, ...]) -> None:
    """Exit code 7 and the command of pip."""
    result = chefbotd(*command, in_a_map)
    assert result.exit_code == Exit.NOT_INSTALLED
    assert "pip install 'chefbotd[maps]'" in result.stderr


def test_the_real_robot_of_that_configuration_does_not(in_a_map: Path) -> None:
    """``check-config`` finds it valid, and notes what a simulation would need."""
    result = chefbotd("check-config", in_a_map)
    assert result.exit_code == 0
    assert result.stderr.startswith("Note: ")
    assert "chefbotd[maps]" in result.stderr


STARTED = """
import gc, os, sys
for package in {packages}:
    sys.modules[package] = None
from chefbotd import start
frozen = []
def tell():
    frozen.append(1)
    if len(frozen) == 2:
        print("chefbotd.components.simulation" in sys.modules, flush=True)
        os._exit(0)
gc.freeze = tell
sys.argv = ["chefbotd", "run", "--sim", "--config", "{robot}", "--listen", "127.0.0.1:0"]
start.chefbotd()
"""
"""The daemon freezes what it has imported, and again what it has built once it listens: this one says so then."""


@pytest.mark.parametrize("robot", sample(ROBOTS))
def test_a_simulated_robot_starts(robot: str) -> None:
    """The daemon listens, with the simulator in it."""
    program = STARTED.format(packages=(*PILLOW, *URDF_PARSER), robot=robot)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert (done.returncode, done.stdout.split()[-1:]) == (0, ["True"]), done.stderr
