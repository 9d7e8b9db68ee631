"""The simulator as a program: what it says, what it obeys, and how it ends."""

import asyncio
import json
import os
import signal
import subprocess
import sys
import threading
import tty
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.simulate import simulate, stdin_lines
from chefbotd.components.simulation.simulation import Simulation
from tests.budget import sample
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.realtime

PROGRAM = """
import asyncio, sys
from pathlib import Path
from chefbotd.components.simulation.simulation import Simulation
from chefbotd.components.simulation.simulate import simulate
asyncio.run(simulate(Simulation(), link_path=Path(sys.argv[1])))
"""


def session(words: list[str], *, link: Path | None = None, as_json: bool = False) -> list[str]:
    """What the program says to these words."""
    said: list[str] = []

    async def commands() -> AsyncIterator[str]:
        for word in words:
            yield word

    async def run() -> None:
        ended = simulate(Simulation(), link_path=link, as_json=as_json, commands=commands(), say=said.append)
        await asyncio.wait_for(ended, PATIENCE_S)

    asyncio.run(run())
    return said


def test_the_device_comes_first(tmp_path: Path) -> None:
    """The first line is the path of a device, and the link is gone after ``quit``."""
    said = session(["quit"], link=tmp_path / "chefbot")
    assert said[0].startswith("/dev/pts/")
    assert not os.path.lexists(tmp_path / "chefbot")


def test_words_are_obeyed_and_answered() -> None:
    """Unplug, plug and reset are confirmed, ``truth`` is JSON, an unknown word is told what is known."""
    said = session(["unplug", "plug", "reset", "  ", "truth", "dance", "quit"])
    assert said[1] == "unplugged"
    assert said[2].startswith("/dev/pts/")
    assert said[3] == "reset"
    truth = json.loads(said[4])
    assert truth["x_m"] == truth["heading_rad"] == 0.0
    assert truth["duty"] == [0, 0]
    assert set(truth) == {
        "x_m",
        "y_m",
        "heading_rad",
        "linear_m_s",
        "angular_rad_s",
        "in_contact",
        "duty",
        "board_s",
        "duty_since_s",
        "heard_s",
    }
    assert said[5] == "unknown word 'dance', expected one of: plug unplug truth reset quit"


def test_a_host_on_the_device_drives_the_robot(capsys: pytest.CaptureFixture[str]) -> None:
    """What a host writes to the device comes into force, as ``truth`` shows; output goes to stdout by default."""

    async def commands() -> AsyncIterator[str]:
        device = capsys.readouterr().out.strip()
        descriptor = os.open(device, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(descriptor)
        os.write(descriptor, b"s 70 -70\r")
        for _ in range(100):
            await asyncio.sleep(0.02)  # real time: the board boots and the bytes go through the kernel
            yield "truth"
            if "[70, -70]" in capsys.readouterr().out:
                break
        else:
            pytest.fail("the command never came into force")
        os.close(descriptor)
        yield "quit"

    parameters = Simulation(SimulationParameters.model_validate({"board": {"boot_s": 0}}))
    asyncio.run(asyncio.wait_for(simulate(parameters, commands=commands()), PATIENCE_S))


def test_json_answers_are_objects() -> None:
    """With ``as_json`` every line is one JSON object."""
    device, unplugged, error = map(json.loads, session(["unplug", "dance", "quit"], as_json=True))
    assert device["device"].startswith("/dev/pts/")
    assert unplugged == {"unplugged": True}
    assert "dance" in error["error"]


def test_a_link_that_cannot_be_made_ends_the_program(tmp_path: Path) -> None:
    """A file in the way of the link is an ``OSError``, not a traceback from some task group."""
    (tmp_path / "chefbot").write_text("")
    with pytest.raises(FileExistsError):
        session(["quit"], link=tmp_path / "chefbot")


@pytest.mark.parametrize("number", sample([signal.SIGTERM, signal.SIGINT]))
def test_signals_end_a_run_without_stdin(tmp_path: Path, number: signal.Signals) -> None:
    """With stdin at its end the program runs on; a signal ends it with status 0 and the link removed."""
    link = tmp_path / "chefbot"
    program = [sys.executable, "-c", PROGRAM, str(link)]
    with subprocess.Popen(program, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("/dev/pts/")
        assert process.poll() is None
        assert link.is_symlink()
        process.send_signal(number)
        assert process.wait(PATIENCE_S) == 0
    assert not os.path.lexists(link)


@pytest.fixture
def stdin() -> Iterator[int]:
    """The writing end of a pipe that is this process's descriptor 0 for the time being."""
    saved, (reading, writing) = os.dup(0), os.pipe()
    os.dup2(reading, 0)
    os.close(reading)
    yield writing
    os.dup2(saved, 0)
    os.close(saved)


def test_stdin_is_read_by_lines(stdin: int) -> None:
    """However the bytes arrive, whole lines come out, and the end of stdin ends them."""

    async def collect() -> list[str]:
        return [line async for line in stdin_lines()]

    os.write(stdin, b"tru")
    os.write(stdin, b"th\nquit\nunfinished")
    os.close(stdin)
    assert asyncio.run(collect()) == ["truth", "quit"]


def test_a_closed_stdin_is_an_empty_one(stdin: int) -> None:
    """A program started without descriptor 0 reads no lines and fails at nothing."""

    async def collect() -> list[str]:
        return [line async for line in stdin_lines()]

    os.close(stdin)
    os.close(0)
    assert asyncio.run(collect()) == []


def test_the_reader_of_stdin_ends_when_nobody_listens(stdin: int) -> None:
    """After the loop has closed, the next line ends the thread: nothing is raised, nothing is left behind."""

    async def first() -> str:
        lines = stdin_lines()
        try:
            return await anext(lines)
        finally:
            await lines.aclose()

    before = set(threading.enumerate())  # another test may have left one of this name
    os.write(stdin, b"one\n")
    assert asyncio.run(first()) == "one"
    reader = next(one for one in threading.enumerate() if one.name == "stdin" and one not in before)
    os.write(stdin, b"two\n")
    reader.join(PATIENCE_S)
    assert not reader.is_alive()
    os.close(stdin)
