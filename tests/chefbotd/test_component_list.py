"""A component of ours touches no file outside its folder but the one list: without both, the rest is whole."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from chefbotd.clock import run_virtual
from chefbotd.component import Component
from chefbotd.component_list import COMMANDS, FIRST, OWN, SCANNING, own_component
from chefbotd.components.agents import component as agents
from chefbotd.rpc.method import Method
from chefbotd.rpc.models import PluginState
from chefbotd.rpc.topics import Topic
from chefbotd.settings import load
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from tests.chefbotd.client.generate import without_component, written
from tests.fakes.robot import methods_of_socket, topics_of

ROOT = Path(__file__).parents[2]
LIST = Path("chefbotd/component_list.py")
BUILT_ON = {
    "calibration": "new_robot writes a robot's file as calibration does, and keeps what was there",
    "doctor": "new_robot, calibration and flash listen to the ports and ask as the doctor does",
    "localization": "navigation drives by its pose",
    "mapping": "localization and navigation match scans with its surfaces, calibration measures motion by them",
    "map_edits": "localization and navigation use maps as they were edited",
    "maps": "mapping, localization and navigation store and read maps there",
    "recording": "foxglove serves what its encoder writes, calibration reads recordings again",
    "simulation": "depth cameras draw its world, and the tests' robot is simulated",
    "zones": "navigation keeps out of them",
    "worker": "the skills of maps, mapping, localization and navigation run in it",
}
"""Those that others build on: without one of these, the others have to go too."""

FREE = tuple(name for name in (*FIRST, *SCANNING, *OWN, *COMMANDS) if name not in BUILT_ON)
"""Those that no other component builds on: each can be taken out by itself."""

WRITTEN = ("chefbotd/client/generated.py", "chefbotd/client/generated_sync.py", "chefbotd/client/models.py")
"""What ``make client`` writes: the typed methods and models of every component that there is. It is written again."""

COPIED = (
    "chefbotd",
    "firmware_protocol",
    "config",
    "tests",
    "docs",
    "pyproject.toml",
    "Makefile",
    "README.md",
)
IGNORED = shutil.ignore_patterns("__pycache__", "*.nb?", "*.nbi", "*.nbc", ".*_cache")
OTHERS_TESTS = (
    "tests/chefbotd/test_bus.py",
    "tests/chefbotd/settings/test_checks.py",
    "tests/chefbotd/driving/test_inner_driver.py",
)
DRIVES = """
import asyncio
from chefbotd.clock import run_virtual
from chefbotd.testing.daemon import simulated_robot

async def drive():
    async with simulated_robot() as robot:
        await robot.client.wait_until_armed()
        for _ in range(20):
            await robot.client.drive(0.2, 0.0)
            await asyncio.sleep(0.1)
        assert robot.board.truth(robot.now_s()).world_from_base.x_m > 0.2

run_virtual(drive())
"""


def without(name: str, folder: Path) -> Path:
    """A copy of the tree without the component's folder and its entry in the list."""
    for entry in COPIED:
        source = ROOT / entry
        if source.is_dir():
            shutil.copytree(source, folder / entry, ignore=IGNORED)
        elif source.exists():
            shutil.copy(source, folder / entry)
    if (known := ROOT / ".mypy_cache").is_dir():  # so that only what differs is checked anew
        shutil.copytree(known, folder / ".mypy_cache")
    shutil.rmtree(folder / "chefbotd" / "components" / name)
    text = (folder / LIST).read_text(encoding="utf-8")
    (folder / LIST).write_text(re.sub(rf'"{name}",?', "", text), encoding="utf-8")
    for whole in (folder / "tests" / "vectors" / "full_configurations").glob(
        "*.toml"
    ):  # its own section goes too
        text = whole.read_text(encoding="utf-8")
        whole.write_text(re.sub(rf"^\[{name}\]\n(?:[^\[\n].*\n|\n)*", "", text, flags=re.M), encoding="utf-8")
    run_in(folder, "-m", "ruff", "format", "-q", str(LIST))
    for path, text in written(*without_component(name, *whole_socket()), removed=(name,)).items():
        (folder / path.relative_to(ROOT)).write_text(text, encoding="utf-8")
    return folder


def whole_socket() -> tuple[dict[str, Method], dict[str, Topic]]:
    """Every method and topic of a robot that has all there is."""
    return methods_of_socket(), topics_of(simulated=True)


def run_in(folder: Path, *command: str) -> str:
    """What a command of Python prints in the copy, which it must end well."""
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    done = subprocess.run(
        [sys.executable, *command], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


@pytest.mark.parametrize("name", sorted(BUILT_ON))
def test_what_others_build_on_is_imported_by_another_component(name: str) -> None:
    """The reason why it cannot be taken out alone still holds."""
    folder = ROOT / "chefbotd" / "components"
    others = [path for path in folder.rglob("*.py") if path.relative_to(folder).parts[0] != name]
    assert any(f"chefbotd.components.{name}." in path.read_text(encoding="utf-8") for path in others)


@pytest.mark.parametrize("name", FREE)
def test_nothing_outside_its_folder_imports_a_component_but_what_is_written(name: str) -> None:
    """Neither at the top of a file, nor in a function; the core names none of them in a text either."""
    module = f"chefbotd.components.{name}"
    package = ROOT / "chefbotd"
    folder = package / "components" / name
    knows = {
        str(path.relative_to(ROOT))
        for path in package.rglob("*.py")
        if folder not in path.parents
        and re.search(rf"{re.escape(module)}\b", path.read_text(encoding="utf-8"))
    }
    assert knows <= set(WRITTEN)


@pytest.mark.skipif(not (ROOT / LIST).exists(), reason="only the sources can be copied")
@pytest.mark.slow
@pytest.mark.parametrize("name", FREE)
def test_without_a_component_the_rest_is_whole(name: str, tmp_path: Path) -> None:
    """Without its folder and its entry: style, types, help, configuration, a drive, and tests of what is left."""
    folder = without(name, tmp_path / "copy")
    run_in(folder, "-m", "ruff", "check", "chefbotd")
    run_in(folder, "-m", "mypy", "-p", "chefbotd")
    run_in(folder, "-c", DRIVES)
    helped = run_in(folder, "-m", "chefbotd.cli.programs.chefbotctl", "--help")
    commands = re.findall(r"^  ([\w-]+) ", helped, re.MULTILINE)
    assert "status" in commands
    assert set(own_component(name).commands) & set(commands) == set()
    checked = run_in(folder, "-m", "chefbotd.cli.programs.chefbotd", "check-config", "--all")
    assert f"\n{name}." not in checked
    run_in(folder, "-m", "pytest", "-q", "-p", "no:cacheprovider", *OTHERS_TESTS)


def test_every_folder_of_a_component_that_is_listed_declares_it() -> None:
    """Under its own name; and each of its references leads somewhere."""
    for name in (*FIRST, *SCANNING, *OWN, *COMMANDS):
        component = own_component(name)
        assert isinstance(component, Component)
        assert component.name == name


def test_a_component_of_ours_that_cannot_be_built_is_said_and_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The robot runs without it, and a client is told why."""

    def fail(context: object) -> None:
        raise OSError("no agents today")

    broken = Component(name="agents", api=1, build=fail)
    monkeypatch.setattr(agents, "COMPONENT", broken)
    own_component.cache_clear()

    async def scenario() -> None:
        async with running_daemon(FakeSerialDevice(), load()) as client:
            assert "topic.agents" not in client.hello.capabilities
            (left_out,) = (await client.list_plugins()).plugins
            assert (left_out.name, left_out.package, left_out.state) == (
                "agents",
                "chefbotd",
                PluginState.FAILED,
            )
            assert left_out.reason == "OSError: no agents today"

    try:
        run_virtual(scenario())
    finally:
        own_component.cache_clear()
