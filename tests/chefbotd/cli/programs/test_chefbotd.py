"""The program chefbotd: configurations checked in this process, daemons and boards run as processes of their own."""

import asyncio
import json
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from chefbotd import __version__
from chefbotd.cli.common.arguments import Address
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.cli.programs.chefbotctl import main as chefbotctl
from chefbotd.cli.programs.chefbotd import main
from chefbotd.client import Client
from chefbotd.settings import packaged
from tests.missing import hide
from tests.robot_files import full
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.realtime

PROGRAM = (sys.executable, "-m", "chefbotd.cli.programs.chefbotd")


def chefbotd(*args: str | Path) -> Result:
    """Run a command to its end."""
    return CliRunner().invoke(main, [str(arg) for arg in args])


def test_version_help_and_completion() -> None:
    """The version is the package's, the help explains the exit codes, the completion is chefbotd's own."""
    assert __version__ in chefbotd("--version").output
    assert "78  the configuration is not valid" in chefbotd("--help").output
    assert "_CHEFBOTD_COMPLETE" in chefbotd("completion", "bash").output


def test_check_config_prints_what_it_resolves_to() -> None:
    """Every value of the packaged ChefBot is on a line of its own, with its dotted key."""
    lines = chefbotd("check-config", "--all").output.splitlines()
    assert 'robot.name = "chefbot"' in lines
    assert "api.port = 7333" in lines
    assert "chassis.wheels.right_wheel.radius_m = 0.045" in lines


def test_a_robot_is_named_or_has_a_file(tmp_path: Path) -> None:
    """A name stands for the configuration that comes with chefbotd, a path for itself."""
    copy = tmp_path / "mine"
    copy.write_bytes(full("chefbot").read_bytes())
    assert (
        chefbotd("check-config", "--all", "chefbot").output == chefbotd("check-config", "--all", copy).output
    )


def test_each_key_that_the_lines_name_can_be_written_in_a_file() -> None:
    """A key by another name would be refused as unknown: each is in the whole configuration as it is named."""
    text = " ".join(line.strip() for line in chefbotd("check-config", "chefbot").output.splitlines())
    whole = chefbotd("check-config", "--all", "chefbot").output
    keys = [key for group in re.findall(r"\((\[.*?)\)", text) for key in re.findall(r"[a-z]+_[a-z_]+", group)]
    assert {"radius_m", "counts_per_turn", "ks_duty", "kv_duty_per_m_s"} <= set(keys)
    absent = [key for key in keys if key not in whole and key != "depth_camera"]  # it has no camera
    assert not absent


@pytest.mark.parametrize("name", ["chefbot", "khan", "chefbot_lidar"])
def test_the_lines_that_matter_fit_a_terminal(name: str) -> None:
    """No line is wider than 80 columns: keys stand below a long value, and a packaged robot has no path."""
    lines = chefbotd("check-config", name).output.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[-1].endswith(f"chefbotd check-config {name} --all")


def test_check_config_prints_the_ten_lines_that_matter_first(tmp_path: Path) -> None:
    """Ten, each with its keys; that nothing sees obstacles, or that the guard is off, is one of them."""
    printed = chefbotd("check-config").output.splitlines()
    lines = [line for line in printed if not line.startswith(" ")]  # behind a long one are its keys
    assert len(lines) == 11
    assert lines[3].split()[:3] == ["track", "0.3", "m"]
    assert lines[-1].startswith("It is valid. ")
    assert lines[-1].endswith("values in all: chefbotd check-config --all")
    assert "guard      on, only in the beam of front   ([safety.guard], [body])" in lines
    seeing = chefbotd("check-config", "chefbot_lidar").output
    assert "guard      on, around the robot's outline: round, 0.36 m" in seeing
    blind = tmp_path / "blind.toml"
    blind.write_text('extends = "chefbot"\nultrasonic = false\n')
    assert (
        "nothing sees obstacles: the robot drives into what is in its way"
        in chefbotd("check-config", blind).output
    )
    blind.write_text('extends = "chefbot"\n[safety.guard]\nenabled = false\n')
    assert "OFF: the robot drives into what it sees" in chefbotd("check-config", blind).output


def test_check_config_as_json() -> None:
    """With --json it is one object with the configuration's own sections."""
    assert json.loads(chefbotd("check-config", "--json").output)["api"]["port"] == 7333


def test_a_bad_configuration(tmp_path: Path) -> None:
    """A refused key ends with the code for it, and the message names file, key and value."""
    path = tmp_path / "bad.toml"
    path.write_text("[api]\nport = 123456\n", encoding="utf-8")
    for command in (["check-config", path], ["run", "--config", path], ["simulate", "--config", path]):
        result = chefbotd(*command)
        assert result.exit_code == Exit.BAD_CONFIGURATION
        for words in (str(path), "api.port", "123456"):
            assert words in result.stderr


@pytest.fixture
def cupboard(tmp_path: Path) -> Path:
    """A simulated KHAN would start in the cupboard."""
    path = tmp_path / "cupboard.toml"
    start = "\n[sim.world]\nstart_x_m = 2.65\nstart_y_m = 0.8\n"
    path.write_text(full("khan").read_text(encoding="utf-8") + start, encoding="utf-8")
    return path


def test_a_real_robot_need_not_be_one_that_can_be_simulated(cupboard: Path) -> None:
    """``check-config`` finds it valid, as ``run`` does, and notes on stderr what ``run --sim`` would refuse."""
    result = chefbotd("check-config", cupboard)
    assert (result.exit_code, "robot      khan, wire 'khan'" in result.stdout) == (0, True)
    (told,) = result.stderr.splitlines()
    assert told.startswith("Note: khan cannot be simulated: ")


@pytest.mark.parametrize("command", [["run", "--sim", "--config"], ["simulate", "--config"]])
def test_a_robot_that_cannot_be_simulated(cupboard: Path, command: list[str]) -> None:
    """One that would start in the cupboard is a bad configuration for a simulation, told in one line."""
    result = chefbotd(*command, cupboard)
    assert result.exit_code == Exit.BAD_CONFIGURATION
    (told,) = result.stderr.splitlines()
    assert told.startswith("Error: khan cannot be simulated: ")
    assert "from a wall" in told


@pytest.mark.parametrize(
    "args",
    [
        ["run", "--sim", "--port", "/dev/ttyUSB0"],
        ["run", "--listen", "7333"],
        ["run", "--config", "/no/such/file.toml"],
        ["run", "--config", "file.toml"],
        ["simulate", "--config", "no-such-robot"],
        ["simulate", "--cycle-hz", "0"],
        ["simulate", "--cycle-hz", "1e9"],
        ["simulate", "--seed", "-1"],
    ],
)
def test_wrong_arguments(args: list[str]) -> None:
    """What cannot be meant is a usage error."""
    assert chefbotd(*args).exit_code == Exit.USAGE


def test_an_unknown_log_level() -> None:
    """The configuration's own check has the last word on overrides."""
    result = chefbotd("run", "--sim", "--log-level", "loud")
    assert result.exit_code == Exit.BAD_CONFIGURATION
    assert "log.level" in result.stderr


def test_a_page_that_is_not_installed_is_told_before_the_robot_is_touched(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Exit code 7 and the command of pip."""
    hide(monkeypatch, "aiohttp")
    result = chefbotd("run", "--sim", "--page")
    assert result.exit_code == Exit.NOT_INSTALLED
    assert "pip install 'chefbotd[page]'" in result.stderr


def test_a_recorder_that_is_asked_for_and_not_installed_is_told_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not after the drive, when there is nothing to replay."""
    hide(monkeypatch, "mcap")
    result = chefbotd("run", "--sim", "--record")
    assert result.exit_code == Exit.NOT_INSTALLED
    assert "pip install 'chefbotd[recording]'" in result.stderr


def test_a_port_that_is_taken() -> None:
    """A second daemon on a port says so in one line, and ends with 1."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        where = f"127.0.0.1:{taken.getsockname()[1]}"
        command = (*PROGRAM, "run", "--sim", "--listen", where)
        ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    (told,) = ended.stderr.splitlines()
    assert (ended.returncode, ended.stdout) == (Exit.FAILED, "")
    assert (
        f'"cannot listen on {where}: address already in use; is another chefbotd running? --listen ' in told
    )
    assert "Traceback" not in told


def test_a_board_that_cannot_be_made(tmp_path: Path) -> None:
    """A link that cannot be placed is an error with a message, not a traceback."""
    link = tmp_path / "no" / "such" / "folder"
    result = chefbotd("simulate", "--link", link)
    assert result.exit_code == Exit.FAILED
    assert result.stderr.startswith(f"Error: {link}: ")
    assert "No such file or directory" in result.stderr
    assert "Traceback" not in result.stderr


def test_a_simulated_board_as_a_process(tmp_path: Path) -> None:
    """It says its device first, keeps the link pointed at it, obeys words, and cleans up."""
    link = tmp_path / "board"
    command = (*PROGRAM, "simulate", "--link", str(link), "--seed", "7", "--cycle-hz", "100", "--json")
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as board:
        assert board.stdin is not None
        assert board.stdout is not None
        device = json.loads(board.stdout.readline())["device"]
        assert link.exists()
        assert Path(device).resolve() == link.resolve()
        board.stdin.write("truth\n")
        board.stdin.flush()
        assert json.loads(board.stdout.readline())["x_m"] == 0.0
        board.stdin.write("quit\n")
        board.stdin.flush()
        assert board.wait(PATIENCE_S) == 0
    assert not link.is_symlink()


@pytest.mark.slow
def test_a_published_sketch_on_a_device(tmp_path: Path) -> None:
    """``--sketch tiva_bare`` sends e, s and b over and over, and neither banner nor time; its first line is cut."""
    link = tmp_path / "board"
    command = (*PROGRAM, "simulate", "--link", str(link), "--sketch", "tiva_bare")
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as board:
        assert board.stdin is not None
        assert board.stdout is not None
        board.stdout.readline()
        with link.open("rb", buffering=0) as port:
            heard = b""
            while heard.count(b"\n") < 100:
                heard += port.read(100)
        board.stdin.write("quit\n")
        board.stdin.flush()
        assert board.wait(PATIENCE_S) == 0
    first, *lines = heard.split(b"\n")[:100]
    assert first[:2] not in (b"e\t", b"s\t", b"b\t")
    kinds = b"".join(line[:1] for line in lines)
    assert kinds in b"esb" * 50


@pytest.mark.parametrize(
    ("args", "told"),
    [
        (("run", "--sketch", "tiva"), "--sketch needs --sim"),
        (("run", "--physics", "mujoco"), "--physics needs --sim"),
        (("simulate", "--physics", "real"), "'planar', 'mujoco'"),
        (("simulate", "--sketch", "uno"), "'tiva', 'tiva_bare', 'duemilanove', 'tiva_second'"),
    ],
)
def test_a_sketch_that_cannot_be(args: tuple[str, ...], told: str) -> None:
    """A real board has its own, and of the published ones there are four."""
    result = chefbotd(*args)
    assert result.exit_code == Exit.USAGE
    assert told in result.stderr


def test_a_published_sketch_on_khans_board() -> None:
    """KHAN's wire is another: the refusal says so."""
    result = chefbotd("run", "--sim", "--config", "khan", "--sketch", "tiva")
    assert result.exit_code == Exit.BAD_CONFIGURATION
    assert "the sketch 'tiva' speaks the wire 'classic', the robot 'khan'" in result.stderr


def test_a_daemon_of_its_own() -> None:
    """The launcher's daemon answers at its address and ends when it is left."""

    async def talk() -> str:
        async with simulated_daemon() as (address, _), Client.connect(address.host, address.port) as robot:
            assert "sim" in (await robot.describe()).topics
            return robot.hello.robot

    assert asyncio.run(talk()) == "chefbot"


def test_a_daemon_that_cannot_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """The launcher says with what code its daemon ended, and how its log ended."""
    monkeypatch.setenv("CHEFBOTD_API__PORT_", "1")

    async def start() -> Address:
        async with simulated_daemon() as (address, _):
            return address

    with pytest.raises(ProgramError, match="ended with exit code 78; its log ends") as caught:
        asyncio.run(start())
    assert "api.port_" in str(caught.value)


def catch_interrupts() -> None:
    """Have SIGINT end the process, also where the tests themselves were started with it ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.slow
def test_signals_end_a_command_in_order() -> None:
    """SIGTERM ends a watching chefbotctl with the code for interruptions, SIGINT the same way."""

    async def interrupt(address: Address, number: signal.Signals) -> int | None:
        command = ("-m", "chefbotd.cli.programs.chefbotctl", "--connect", str(address), "watch", "odometry")
        watching = await asyncio.create_subprocess_exec(
            sys.executable,
            *command,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            preexec_fn=catch_interrupts,
        )
        assert watching.stdout is not None
        await watching.stdout.readline()
        os.kill(watching.pid, number)
        await watching.communicate()
        return watching.returncode

    async def main() -> list[int | None]:
        async with simulated_daemon() as (address, _):
            return [await interrupt(address, number) for number in (signal.SIGTERM, signal.SIGINT)]

    assert asyncio.run(main()) == [Exit.INTERRUPTED, Exit.INTERRUPTED]


def test_a_demonstration_of_a_robot_of_ones_own(tmp_path: Path) -> None:
    """``square --sim --robot FILE`` drives the robot of that file."""
    mine = tmp_path / "mine.toml"
    mine.write_text("[robot]\nname = 7\n", encoding="utf-8")
    result = CliRunner().invoke(chefbotctl, ["square", "--sim", "--robot", str(mine)])
    assert result.exit_code == Exit.CANNOT_CONNECT
    assert "robot.name" in result.stderr


def test_a_demonstration_that_cannot_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """``square --sim`` passes on why its own daemon did not start."""
    monkeypatch.setenv("CHEFBOTD_API__PORT_", "1")
    result = CliRunner().invoke(chefbotctl, ["square", "--sim"])
    assert result.exit_code == Exit.CANNOT_CONNECT
    assert "api.port_" in result.stderr


@pytest.mark.parametrize("robot", ["chefbot", "khan"])
def test_a_robot_of_ones_own(tmp_path: Path, robot: str) -> None:
    """What README says: begin, change the wheels' radius, and it is valid, and described as it is now."""
    folder = tmp_path / "new" / "mine"
    begun = chefbotd("init", "--robot", robot, folder)
    assert begun.exit_code == 0
    config = folder / f"{robot}.toml"
    assert config.read_bytes() == packaged(robot).read_bytes()
    assert [path.name for path in folder.iterdir()] == [config.name]
    assert f"chefbotd run --config {config}" in begun.output
    before = {"chefbot": "radius_m = 0.045", "khan": "radius_m = 0.03\n"}[robot]
    config.write_text(config.read_text().replace(before, "radius_m = 0.052\n"))
    assert chefbotd("check-config", config).exit_code == 0
    assert 'cylinder radius="0.052"' in chefbotd("urdf", config).output


def test_a_robot_of_ones_own_is_never_overwritten(tmp_path: Path) -> None:
    """Nothing is written when the file is there."""
    (tmp_path / "chefbot.toml").write_text("mine")
    again = chefbotd("init", tmp_path)
    assert again.exit_code == Exit.FAILED
    assert again.stderr.startswith(f"Error: {tmp_path}/chefbot.toml: already exists")
    assert (tmp_path / "chefbot.toml").read_text() == "mine"


def test_a_robot_of_ones_own_that_cannot_begin(tmp_path: Path) -> None:
    """An unknown robot is told which there are; a folder within a file, that it cannot be."""
    assert "there are: chefbot, chefbot_lidar, khan" in chefbotd("init", "--robot", "marvin", tmp_path).stderr
    (tmp_path / "file").write_text("")
    within = chefbotd("init", tmp_path / "file" / "robot")
    assert (within.exit_code, "file/robot: cannot be written: Not a directory" in within.stderr) == (1, True)


def test_a_folder_is_no_configuration(tmp_path: Path) -> None:
    """It is told as one, with the file in it that may have been meant."""
    chefbotd("init", tmp_path)
    told = chefbotd("check-config", tmp_path)
    assert told.exit_code == Exit.USAGE
    assert f"is a folder, expected a TOML file, such as {tmp_path}/chefbot.toml" in " ".join(
        told.stderr.split()
    )


def test_a_lidar_with_the_guard_off_and_without_a_body_is_noted(tmp_path: Path) -> None:
    """``check-config`` says on stderr what stops the robot for nothing, and asks for the robot's outline."""
    text = full("chefbot_lidar").read_text(encoding="utf-8")
    text = text.replace("\nenabled = true\nstop_distance_m", "\nenabled = false\nstop_distance_m")
    body = text.index("[body]")
    path = tmp_path / "off.toml"
    path.write_text(text[:body] + text[text.index("[encoders]") :], encoding="utf-8")
    result = chefbotd("check-config", path)
    assert result.exit_code == 0
    off, outline = result.stderr.splitlines()
    assert "a lidar (lidar) and an ultrasonic (front), and the guard is off" in off
    assert "no [body]" in outline
