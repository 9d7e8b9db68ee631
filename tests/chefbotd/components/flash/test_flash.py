"""Flashing, with a simulated board behind a pseudo-terminal and the real avrdude, or a stand-in for openocd."""

import json
import os
import pty
import shutil
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
import serial
from click.testing import CliRunner, Result

from chefbotd.cli.programs.chefbotctl import main
from chefbotd.components.doctor.listening.ports import SerialPort
from chefbotd.components.flash import command, procedure
from chefbotd.components.flash.images import Image
from tests.chefbotd.components.flash.board import OLD_PROGRAM, Duemilanove
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.realtime

NEW_PROGRAM = (bytes(range(1, 201)) * 10)[: len(OLD_PROGRAM)]
OURS = b"firmware\t1\t0\t1\t1\t7\t1\n"
SPEECH = {NEW_PROGRAM: OURS, OLD_PROGRAM: b"Initializing I2C devices...\r\n"}

Flash = Callable[..., Result]


@pytest.fixture
def board() -> Iterator[Duemilanove]:
    """A board with the classic sketch."""
    simulated = Duemilanove(SPEECH)
    yield simulated
    simulated.close()


@pytest.fixture
def flash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Flash:
    """``chefbotctl flash`` with an image of version 0.1, a state folder of its own, and a short patience."""
    image = tmp_path / "new.bin"
    image.write_bytes(NEW_PROGRAM)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    monkeypatch.setattr(procedure, "STOP_S", 0.2)
    monkeypatch.setattr(procedure, "HEAR_S", PATIENCE_S)
    monkeypatch.setattr(
        command, "_image", lambda board, own: Image(own) if own is not None else Image(image, "0.1")
    )

    def run(*words: str, answer: str = "yes\n") -> Result:
        return CliRunner().invoke(main, ["flash", *words], input=answer)

    return run


def kept(tmp_path: Path) -> list[Path]:
    """The old programs that were kept."""
    return sorted((tmp_path / "state").rglob("*.bin"))


needs_avrdude = pytest.mark.skipif(
    shutil.which("avrdude") is None and os.environ.get("FIRMWARE_TESTS") != "required",
    reason="avrdude is not installed (Debian's package avrdude)",
)


@needs_avrdude
def test_a_board_is_flashed_verified_heard_and_can_go_back(
    board: Duemilanove, flash: Flash, tmp_path: Path
) -> None:
    """The motors are stopped first, the old program is kept byte for byte, and its file is the way back."""
    result = flash("--board", "duemilanove", "--port", board.device)
    assert result.exit_code == 0, result.output
    assert board.heard.startswith(b"s 0 0\rs 0 0\r")
    assert board.program() == NEW_PROGRAM
    assert "The board runs firmware 0.1: it stops by itself." in result.output
    (old,) = kept(tmp_path)
    assert old.read_bytes() == OLD_PROGRAM
    back = f"chefbotctl flash --board duemilanove --port {board.device} --image {old}"
    assert back in result.output.replace("\n", "")
    assert flash(*back.split()[2:]).exit_code == 0
    assert board.program() == OLD_PROGRAM


@pytest.mark.slow
@needs_avrdude
def test_a_write_that_fails_is_tried_again(flash: Flash) -> None:
    """Avrdude's verification sees the damaged page."""
    board = Duemilanove(SPEECH, refused_pages=1)
    try:
        result = flash("--board", "duemilanove", "--port", board.device)
        assert result.exit_code == 0, result.output
        assert "Writing failed (try 1 of 3): avrdude ended with exit code 1" in result.output
        assert board.program() == NEW_PROGRAM
    finally:
        board.close()


class CountingLine(serial.Serial):  # type: ignore[misc]
    """Its time is what was read: a second for each reading, and hardly any for one that got nothing."""

    now_s = 0.0

    def read(self, size: int = 1) -> bytes:
        data = bytes(super().read(size))
        CountingLine.now_s += 1.0 if data else 0.1
        return data


@pytest.mark.slow
@needs_avrdude
def test_a_board_that_does_not_name_itself_afterwards_is_an_error_that_says_how_to_go_back(
    flash: Flash, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was programmed, but what runs on it is not what was written, as far as can be heard: by ten readings."""
    monkeypatch.setattr(procedure.serial, "Serial", CountingLine)
    monkeypatch.setattr(procedure, "time", SimpleNamespace(monotonic=lambda: CountingLine.now_s))
    monkeypatch.setattr(procedure, "HEAR_S", 10.0)
    board = Duemilanove({NEW_PROGRAM: b"hello\n"})
    try:
        result = flash("--board", "duemilanove", "--port", board.device)
    finally:
        board.close()
    assert result.exit_code == 1
    assert "says 'hello': firmware 0.1 was expected. To go back: chefbotctl flash" in result.stderr


# A stand-in for openocd: reads and writes a file in place of a flash memory, and fails as often as it is told to.
STAND_IN = """#!{python}
import pathlib, re, sys
here = pathlib.Path({here!r})
words = " ".join(sys.argv[1:])
with (here / "calls").open("a") as calls:
    calls.write(words + "\\n")
fails = here / ("fail_read" if "dump_image" in words else "fail_write")
if fails.exists():
    left = int(fails.read_text()) - 1
    fails.write_text(str(left)) if left else fails.unlink()
    print("Error: no device found")
    sys.exit(1)
if found := re.search(r"dump_image {{(.*?)}}", words):
    pathlib.Path(found[1]).write_bytes((here / "flash").read_bytes())
elif found := re.search(r"program {{(.*?)}}", words):
    (here / "flash").write_bytes(pathlib.Path(found[1]).read_bytes())
"""


@pytest.fixture
def openocd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the stand-in, first on the PATH."""
    here = tmp_path / "openocd"
    here.mkdir()
    (here / "flash").write_bytes(OLD_PROGRAM + b"\xff" * 500)
    program = here / "openocd"
    program.write_text(STAND_IN.format(python=sys.executable, here=str(here)))
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{here}{os.pathsep}{os.environ['PATH']}")
    return here


@pytest.fixture
def talking(board: Duemilanove) -> Duemilanove:
    """A board that names itself, whatever openocd does."""
    board.flash[: len(OLD_PROGRAM)] = b"\xff" * len(OLD_PROGRAM)
    board.flash[: len(NEW_PROGRAM)] = NEW_PROGRAM
    return board


def test_json_has_all_that_was_done(
    talking: Duemilanove, flash: Flash, openocd: Path, tmp_path: Path
) -> None:
    """For scripts: what was written where, what was kept, and what the board said."""
    result = flash("--board", "tiva", "--port", talking.device, "--yes", "--json")
    assert result.exit_code == 0, result.output
    (old,) = kept(tmp_path)
    told = json.loads(result.stdout)
    assert told | {"command": ""} == {
        "board": "tiva",
        "port": talking.device,
        "programmer": "openocd",
        "image": str(tmp_path / "new.bin"),
        "version": "0.1",
        "dry_run": False,
        "command": "",
        "kept": str(old),
        "heard": OURS.decode().strip(),
    }
    assert (openocd / "flash").read_bytes() == NEW_PROGRAM
    assert old.read_bytes() == OLD_PROGRAM


def test_a_dry_run_touches_nothing(talking: Duemilanove, flash: Flash, openocd: Path) -> None:
    """It says the command, and opens neither the port nor the programmer."""
    result = flash("--board", "tiva", "--port", talking.device, "--dry-run")
    assert result.exit_code == 0
    assert "Would run: openocd -f board/ti_ek-tm4c123gxl.cfg -c 'program {" in result.output
    assert not (openocd / "calls").exists()
    assert talking.heard == b""


@pytest.mark.parametrize("answer", ["", "\n", "y\n", "no\n"])
def test_nothing_is_touched_unless_yes_was_typed(
    answer: str, talking: Duemilanove, flash: Flash, openocd: Path
) -> None:
    """Whole; the end of the input is no."""
    result = flash("--board", "tiva", "--port", talking.device, answer=answer)
    assert result.exit_code == 1
    assert "'yes' was not typed: nothing was touched" in result.stderr
    assert not (openocd / "calls").exists()
    assert talking.heard == b""


def test_a_port_in_use_is_not_touched(talking: Duemilanove, flash: Flash, openocd: Path) -> None:
    """The daemon would write between, and its dead-man would be ours."""
    with serial.Serial(talking.device, exclusive=True):
        result = flash("--board", "tiva", "--port", talking.device)
    assert result.exit_code == 1
    assert not (openocd / "calls").exists()


def test_a_read_that_fails_is_tried_again(talking: Duemilanove, flash: Flash, openocd: Path) -> None:
    """Twice in a row, as a write: the third try keeps the old program."""
    (openocd / "fail_read").write_text("2")
    result = flash("--board", "tiva", "--port", talking.device)
    assert "Reading the old program failed (try 2 of 3): openocd ended with exit code 1" in result.output
    assert "The old program is kept in" in result.output


def test_nothing_is_written_if_the_old_program_cannot_be_read(
    talking: Duemilanove, flash: Flash, openocd: Path, tmp_path: Path
) -> None:
    """There would be no way back."""
    (openocd / "fail_read").write_text("9")
    result = flash("--board", "tiva", "--port", talking.device)
    assert result.exit_code == 1
    assert (
        "the old program cannot be read, so nothing was written: openocd ended with exit code 1: Error"
        in (result.stderr)
    )
    assert (openocd / "flash").read_bytes().startswith(OLD_PROGRAM)
    assert not list((tmp_path / "state").rglob("*.*"))


@pytest.mark.parametrize(
    ("error", "exit_code"), [(OSError(28, "No space left on device"), 1), (KeyboardInterrupt(), 130)]
)
def test_nothing_is_left_over_if_the_old_program_cannot_be_kept(
    error: BaseException,
    exit_code: int,
    talking: Duemilanove,
    flash: Flash,
    openocd: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not even what would fill a full disk; nothing is written to the board."""

    def fail(descriptor: int) -> None:
        raise error

    monkeypatch.setattr(os, "fsync", fail)
    assert flash("--board", "tiva", "--port", talking.device).exit_code == exit_code
    assert (openocd / "flash").read_bytes().startswith(OLD_PROGRAM)
    assert not list((tmp_path / "state").rglob("*.*"))


def test_a_disk_that_is_nearly_full_is_said_before_the_board_is_read(
    talking: Duemilanove, flash: Flash, openocd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A programmer that runs out of room may not say so, and half a program is no way back."""
    usage = shutil.disk_usage("/")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=100_000))
    result = flash("--board", "tiva", "--port", talking.device)
    assert result.exit_code == 1
    assert "cannot be kept" in result.stderr
    assert not (openocd / "calls").exists()


def test_an_empty_board_has_no_program_to_go_back_to(
    talking: Duemilanove, flash: Flash, openocd: Path, tmp_path: Path
) -> None:
    """An empty file would be offered as one."""
    (openocd / "flash").write_bytes(b"\xff" * 500)
    result = flash("--board", "tiva", "--port", talking.device)
    assert result.exit_code == 0, result.output
    assert "To go back, upload the classic sketch" in result.output
    assert not list((tmp_path / "state").rglob("*.*"))


def test_lm4flash_is_not_given_a_hex_file(
    talking: Duemilanove, flash: Flash, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would write its letters to the board."""
    program = tmp_path / "lm4flash"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    image = tmp_path / "own.hex"
    image.write_bytes(b":00000001FF\n")
    result = flash("--board", "tiva", "--port", talking.device, "--image", str(image))
    assert result.exit_code == 1
    assert "lm4flash writes .bin files only" in result.stderr


TALKATIVE = """
import pathlib, sys, time
here = pathlib.Path(sys.argv[1])
(here / "began").touch()
while not (here / "go_on").exists():
    time.sleep(0.01)
for _ in range(3):
    print("** Programming **", flush=True)
(here / "whole").touch()
"""


def test_a_write_ends_whole_where_this_program_is_killed(tmp_path: Path) -> None:
    """So does one whose terminal was closed: the programmer goes on, whoever reads what it says."""
    command = [sys.executable, "-c", TALKATIVE, str(tmp_path)]
    code = f"from chefbotd.components.flash.procedure import run; run({command!r})"
    with subprocess.Popen([sys.executable, "-c", code]) as program:
        wait_until((tmp_path / "began").exists)
        program.kill()
    (tmp_path / "go_on").touch()
    wait_until((tmp_path / "whole").exists)


def test_after_three_failures_the_error_says_what_state_the_board_is_in(
    talking: Duemilanove, flash: Flash, openocd: Path
) -> None:
    """And how to have the old program again."""
    (openocd / "fail_write").write_text("9")
    result = flash("--board", "tiva", "--port", talking.device)
    assert result.exit_code == 1
    assert "half a program, which may do anything: keep the wheels off the ground" in result.stderr
    assert "To go back: chefbotctl flash --board tiva" in result.stderr
    assert (openocd / "calls").read_text().count("program {") == 3


def test_the_way_back_after_a_failed_write_is_the_program_from_before_it(
    talking: Duemilanove, flash: Flash, openocd: Path, tmp_path: Path
) -> None:
    """The second run reads half a program: it is no way back, neither then nor when the third succeeds."""
    (openocd / "fail_write").write_text("3")
    flash("--board", "tiva", "--port", talking.device)
    (old,) = kept(tmp_path)
    (marker,) = (tmp_path / "state").rglob("*.unfinished")
    (openocd / "flash").write_bytes(b"half a program")
    (openocd / "fail_write").write_text("3")
    again = flash("--board", "tiva", "--port", talking.device)
    last = flash("--board", "tiva", "--port", talking.device)
    assert last.exit_code == 0, last.output
    for result in (again, last):
        assert (
            f"To go back: chefbotctl flash --board tiva --port {talking.device} --image {old}\n"
            in result.output
        )
    assert not marker.exists()


def test_after_a_write_that_succeeded_the_way_back_is_the_newest_program(
    talking: Duemilanove, flash: Flash, openocd: Path, tmp_path: Path
) -> None:
    """Nothing is left of the first run that the second could take for a failure."""
    flash("--board", "tiva", "--port", talking.device)
    (first,) = kept(tmp_path)
    first = first.rename(first.with_name("tiva-first.bin"))
    result = flash("--board", "tiva", "--port", talking.device)
    (second,) = set(kept(tmp_path)) - {first}
    assert f"--image {second}\n" in result.output
    assert second.read_bytes() == NEW_PROGRAM


@contextmanager
def sketch(speak: Callable[[int], None]) -> Iterator[SerialPort]:
    """A board that calls ``speak`` with its end of the line when it has read a stop."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    os.write(ours, b"s\t0.00\t0.00\n")  # old, or the end of another line

    def run() -> None:
        while b"\r" not in os.read(ours, 64):
            pass
        speak(ours)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield SerialPort(os.ttyname(theirs))
    finally:
        os.write(theirs, b"\r")  # if it has heard nothing
        thread.join()
        os.close(ours)
        os.close(theirs)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (b"s\t80.00\t-70.00\n", b"s\t0.00\t0.00\n"),
        (b"s\t80\t-70\t3\t7*1234\n", b"s\t0\t0\t3\t8*1234\n"),
    ],
    ids=["classic", "checked"],
)
def test_a_stop_is_waited_for_until_the_board_shows_it(
    before: bytes, after: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sketch that waits for an echo reads the stop late: its motors are off before anything else is done to it."""
    monkeypatch.setattr(procedure, "STOP_S", PATIENCE_S)
    is_shown = threading.Event()

    def speak(line: int) -> None:
        for _ in range(5):
            time.sleep(0.1)
            os.write(line, b"t\t1\t0.05\n" + before)
        is_shown.set()
        os.write(line, after)

    with sketch(speak) as port:
        procedure.stop_motors(port, pytest.fail)
        assert is_shown.is_set()


class Deaf:
    """A line in memory, on which a board tells its duty once in 0.1 s and hears nothing; ``now_s`` is its time."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.in_waiting = 0

    def __enter__(self) -> "Deaf":
        return self

    def __exit__(self, *error: object) -> None:
        """Closed."""

    def read(self, size: int) -> bytes:
        self.now_s += 0.1
        return b"s\t80.00\t0.00\n"

    def write(self, data: bytes) -> None:
        """Lost."""

    flush = reset_input_buffer = lambda self: None


def test_a_board_that_does_not_stop_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its program may be one that obeys nothing, so it is replaced all the same: after 1.5 s."""
    line = Deaf()
    monkeypatch.setattr(procedure, "time", SimpleNamespace(monotonic=lambda: line.now_s))
    monkeypatch.setattr(procedure.serial, "Serial", lambda *arguments, **options: line)
    told: list[str] = []
    procedure.stop_motors(SerialPort("/dev/deaf"), told.append)
    assert told == [
        "The board does not confirm the stop: it reports duty (80.0, 0.0). Its wheels may turn meanwhile."
    ]
    assert line.now_s == pytest.approx(1.5, abs=0.101)


def test_a_programmer_that_is_not_installed_is_named_with_its_package(
    board: Duemilanove, flash: Flash, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 7, as for any missing part."""
    monkeypatch.setenv("PATH", "/nonexistent")
    result = flash("--board", "tiva", "--port", board.device)
    assert result.exit_code == 7
    assert "'sudo apt install openocd' or 'sudo apt install lm4flash'" in result.stderr


@pytest.mark.parametrize(
    ("line", "version"),
    [
        (b"firmware\t1\t0\t1\t1\t7\t1", "0.1"),
        (b"firmware\t1\t2\t13\t2\t15\t4", "2.13"),
        (b"firmware", ""),
        (b"firmware\t1\tx\t1", ""),
        (b"t\t1\t0.02", ""),
    ],
)
def test_the_version_is_read_from_the_line_by_which_the_board_names_itself(line: bytes, version: str) -> None:
    """docs/firmware_wire.md: the second and third number."""
    assert procedure.version_in(line) == version
