"""``chefbotctl flash`` as somebody at a terminal sees it: its own image, its questions, and wheels turned by hand."""

import os
import pty
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.chefbotd.components.flash.board import OLD_PROGRAM, Duemilanove
from tests.waiting import wait_until

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.skipif(
        shutil.which("avrdude") is None and os.environ.get("FIRMWARE_TESTS") != "required",
        reason="avrdude is not installed (Debian's package avrdude)",
    ),
]

OURS = b"firmware\t1\t0\t1\t1\t7\t1\n"
"""Our firmware 0.1 on an ATmega328P."""


class Terminal:
    """A program on a terminal of its own."""

    def __init__(self, words: list[str], environment: dict[str, str]) -> None:
        self._ours, theirs = pty.openpty()
        os.set_blocking(self._ours, False)
        self.program = subprocess.Popen(
            [sys.executable, "-m", "chefbotd.cli.programs.chefbotctl", *words],
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            env={**os.environ, **environment},
        )
        os.close(theirs)
        self._shown = b""

    def shown(self) -> str:
        """What has been shown since the last answer, without line ends."""
        with suppress(BlockingIOError, OSError):  # nothing new, or the program has ended
            while data := os.read(self._ours, 65536):
                self._shown += data
        return " ".join(self._shown.decode(errors="replace").split())

    def answer(self, question: str, answer: str) -> None:
        """Wait for this question, and type an answer."""
        wait_until(lambda: question in self.shown() or self.program.poll() is not None)
        assert question in self.shown()
        self._shown = b""
        os.write(self._ours, answer.encode() + b"\r")

    def end(self) -> str:
        """Wait for the program's end; what it has shown since the last answer."""
        wait_until(lambda: bool(self.shown()) and self.program.poll() is not None)
        text = self.shown()
        os.close(self._ours)
        return text


@pytest.fixture
def board() -> Iterator[Duemilanove]:
    """A board with the classic sketch, on which any other program is our firmware."""
    simulated = Duemilanove(
        {OLD_PROGRAM: b"Initializing I2C devices...\r\n"}, otherwise=OURS, held_open=False
    )
    yield simulated
    simulated.close()


def flash(board: Duemilanove, tmp_path: Path) -> Terminal:
    """The command for this board, with its wheels off the ground."""
    words = ["flash", "--board", "duemilanove", "--port", board.device]
    terminal = Terminal(words, {"XDG_STATE_HOME": str(tmp_path), "COLUMNS": "80"})
    terminal.answer("Lift the robot so that no wheel touches the ground, then type yes", "yes")
    return terminal


def test_flash_asks_for_ten_turns_and_says_what_its_figure_rests_on(
    board: Duemilanove, tmp_path: Path
) -> None:
    """84,100 counts on the left and 83,900 on the right in ten turns each are 8400, and not four times any figure."""
    terminal = flash(board, tmp_path)
    terminal.answer("Now measure what a turn counts, by 10 turns of each wheel by hand: ready?", "")
    for wheel, (name, counts) in enumerate((("left", 84_100), ("right", 83_900))):
        terminal.answer(f"Mark where the {name} wheel stands, and leave both wheels alone: ready?", "")
        question = f"Turn the {name} wheel forward by hand, 10 whole turns, back to its mark: done?"
        wait_until(lambda asked=question: asked in terminal.shown())
        board.counts[wheel] += counts
        terminal.answer(question, "")
    text = terminal.end()
    assert terminal.program.returncode == 0, text
    assert board.program() != OLD_PROGRAM
    assert 'Set [encoders] counts_per_turn = 8400 and counted_by = "firmware"' in text
    assert "10 turns by hand counted 84100 on the left and 83900 on the right" in text
    assert "chefbotd does not drive before" in text


@pytest.mark.slow
def test_flash_gives_no_figure_where_nobody_turns_the_wheels(board: Duemilanove, tmp_path: Path) -> None:
    """The board is flashed; what a turn counts is said to be unknown, and to be measured before anything drives."""
    terminal = flash(board, tmp_path)
    terminal.answer("ready?", "n")
    text = terminal.end()
    assert terminal.program.returncode == 0, text
    assert "What a turn of a wheel counts was not measured" in text
    assert "counts_per_turn =" not in text
