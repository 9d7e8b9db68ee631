"""Runs every command in an installation without extras and add-ons, and reports how each ended.

``python tests/core_install.py`` tries the installation it runs in; with ``--hide`` the packages of the extras are as if
they were not installed. One line of JSON for each command: ``command``, ``exit_code``, ``output``, ``problem``.
"""

import json
import os
import shlex
import sys
import tempfile
import traceback
from collections.abc import Iterator
from pathlib import Path

import click
from click.testing import CliRunner

NOT_INSTALLED = 7

WHOLE = Path(__file__).resolve().parent / "vectors" / "full_configurations" / "chefbot.toml"
"""A configuration with every section, commented or not."""

NOBODY = "127.0.0.1:1"
"""No daemon answers there."""

OF_EXTRAS = [
    "PIL",
    "aiohttp",
    "foxglove",
    "ifaddr",
    "llvmlite",
    "lxml",
    "lz4",
    "matplotlib",
    "mcap",
    "mujoco",
    "numba",
    "openni",
    "prometheus_client",
    "scipy",
    "sdl2",
    "segno",
    "textual",
    "textual_hires_canvas",
    "textual_plot",
    "tomlkit",
    "urdf_parser_py",
    "websockets",
    "zeroconf",
    "zstandard",
]
"""What the extras for users bring, by the names that are imported."""

NOT_OURS = ("IPython", "chefbot_devtools", "chefbot_ros2", "examples", "rosbags")

NEEDS = {
    "chefbotd check-config described.toml": "urdf",
    "chefbotd replay drive.mcap": "recording",
    "chefbotd run --sim --foxglove": "foxglove",
    "chefbotd run --sim --page": "page",
    "chefbotd run --sim --record": "recording",
    "chefbotd run --sim --physics mujoco": "mujoco",
    "chefbotd run --sim --config discovered.toml": "discovery",
    "chefbotd run --sim --config in_a_map.toml": "maps",
    "chefbotd simulate --physics mujoco": "mujoco",
    "chefbotd simulate --config in_a_map.toml": "maps",
    "chefbotd urdf described.toml": "urdf",
    "chefbotctl --robot kitchen status": "discovery",
    "chefbotctl calibrate --from drive.mcap": "recording",
    "chefbotctl calibrate --out plots": "plot",
    "chefbotctl calibrate --apply --config robot.toml": "tune",
    "chefbotctl joystick": "joystick",
    "chefbotctl log export drive.mcap --csv tables": "recording",
    "chefbotctl log info drive.mcap": "recording",
    "chefbotctl log plot drive.mcap": "plot,recording",
    "chefbotctl log export drive.mcap --ros2 bag": "recording",
    "chefbotctl map export folder --mode scale": "maps",
    "chefbotctl map from-bag bag flat --folder .": "navigation",
    "chefbotctl map show --png map.png": "maps",
    "chefbotctl pid save robot.toml": "tune",
    "chefbotctl pid tune": "tune",
    "chefbotctl robots": "discovery",
    "chefbotctl teleop": "teleop",
}
"""What needs an extra, and which."""

ELSEWHERE = {
    "chefbotctl calibrate --sim 1": "make calibrate",
    "chefbotctl map demo": "make map",
    "chefbotctl serve": "make serve",
    "chefbotctl shell": "./addons/chefbot-devtools",
    "chefbotctl sweep program.py": "./addons/chefbot-devtools",
}
"""What is in an add-on, or only in a checkout; and what the message names."""

OTHERS = (
    "chefbotd check-config",
    "chefbotd completion bash",
    "chefbotd init folder",
    "chefbotd install-service --dry-run --root folder",
    "chefbotd new-component trip --into component",
    "chefbotd new-plugin trip",
    "chefbotd uninstall-service --dry-run --root folder",
    "chefbotd urdf",
    "chefbotctl calibrate",
    "chefbotctl completion bash",
    "chefbotctl drive 0.1 0 --for 1",
    "chefbotctl doctor --port /dev/null --yes --seconds 1",
    "chefbotctl flash --dry-run --board tiva --port /dev/null",
    "chefbotctl go table",
    "chefbotctl map delete flat --yes",
    "chefbotctl map export folder",
    "chefbotctl map finish flat",
    "chefbotctl map import flat.yaml",
    "chefbotctl map load flat",
    "chefbotctl map rename flat house",
    "chefbotctl map show flat",
    "chefbotctl map start flat",
    "chefbotctl pid set left_wheel kp=0.1",
    "chefbotctl places delete door",
    "chefbotctl places save door",
    "chefbotctl patrol a b",
    "chefbotctl record evening",
    "chefbotctl watch odometry",
    "chefbotctl wheels left_wheel=1 --for 1",
)
"""What works without, or fails only because no daemon answers; commands without arguments are added."""


def leaves(command: click.Command, words: tuple[str, ...]) -> Iterator[str]:
    """Every command below a group, by its words."""
    if not isinstance(command, click.Group):
        yield " ".join(words)
        return
    context = click.Context(command)
    for name in command.list_commands(context):
        inner = command.get_command(context, name)
        assert inner is not None
        yield from leaves(inner, (*words, name))


def write_files() -> None:
    """The files that the commands above name."""
    text = WHOLE.read_text(encoding="utf-8")
    Path("robot.toml").write_text(text, encoding="utf-8")
    Path("drive.mcap").write_bytes(b"\x89MCAP0\r\n")
    Path("described.urdf").write_text('<robot name="chefbot"/>', encoding="utf-8")
    described = text.replace('# description = "my.urdf"', 'description = "described.urdf"')
    assert described != text
    Path("described.toml").write_text(described, encoding="utf-8")
    Path("discovered.toml").write_text(
        text.replace("[discovery]\nenabled = false", "[discovery]\nenabled = true"), encoding="utf-8"
    )
    Path("flat.pgm").write_bytes(b"P5\n30 20\n255\n" + (b"\0" + b"\xfe" * 29) * 20)
    Path("flat.yaml").write_text("image: flat.pgm\nresolution: 0.1\norigin: [-1.0, -0.7, 0]\nnegate: 0\n")
    Path("in_a_map.toml").write_text(text + '\n[sim]\nworld = "flat.yaml"\n', encoding="utf-8")
    Path("program.py").touch()


def programs() -> dict[str, click.Command]:
    """The command lines; loaded when what is to be missing is missing."""
    from chefbotd.cli.programs import chefbotctl, chefbotd

    return {"chefbotd": chefbotd.main, "chefbotctl": chefbotctl.main}


def tried() -> list[str]:
    """Every command, with words or without."""
    lines = [*NEEDS, *ELSEWHERE, *OTHERS]
    for name, program in programs().items():
        for leaf in leaves(program, (name,)):
            if not any(line == leaf or line.startswith(f"{leaf} ") for line in lines):
                lines.append(leaf)
    return lines


def main(arguments: list[str]) -> int:
    """Try them all; the exit code says whether any ended in another way than with an exit code of its own."""
    if "--hide" in arguments:
        sys.modules |= dict.fromkeys((*OF_EXTRAS, *NOT_OURS))  # type: ignore[arg-type]
    of_program, failed = programs(), False
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        os.environ |= {"HOME": folder, "XDG_STATE_HOME": folder, "CHEFBOTCTL_CONNECT": NOBODY}
        write_files()
        Path("folder").mkdir()
        for line in tried():
            words = shlex.split(line)
            result = CliRunner().invoke(of_program[words[0]], words[1:])
            problem = ""
            if result.exc_info is not None and not isinstance(result.exception, SystemExit | None):
                problem = "".join(traceback.format_exception(*result.exc_info))
            row = {
                "command": line,
                "exit_code": result.exit_code,
                "output": result.output,
                "problem": problem,
            }
            needs_more = line in NEEDS or line in ELSEWHERE
            failed |= bool(problem) or (needs_more and result.exit_code != NOT_INSTALLED)
            sys.stdout.write(json.dumps(row) + "\n")
            sys.stdout.flush()
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
