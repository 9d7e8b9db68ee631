"""How the programs start and end in a shell."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.budget import sample
from tests.waiting import PATIENCE_S

SLOW_IMPORT = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell starts its background jobs without it
class Slow:
    def find_spec(self, name, *_):
        if name == "click":
            print("importing", flush=True)
            time.sleep(1000)
sys.meta_path.insert(0, Slow())
from chefbotd import start
start.%s()
"""


@pytest.mark.parametrize("program", ["chefbotd", "chefbotctl"])
def test_ctrl_c_while_it_is_still_importing_says_so_in_a_word(program: str) -> None:
    """Exit code 130, and no traceback."""
    with subprocess.Popen(
        [sys.executable, "-c", SLOW_IMPORT % program, "--help"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"importing\n"
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, said) == (130, b"Interrupted.\n")


LOADED = """
import os, sys, tty
from chefbotd import start
ours, board = os.openpty()
tty.setraw(board)
def write(descriptor, data, write=os.write):
    if data.startswith(b"s ") and ("chefbotd.app" in sys.modules) is %s:
        print(*sys.modules, flush=True)
        os._exit(0)
    return write(descriptor, data)
os.write = write
sys.argv = ["chefbotd", "run", "--port", os.ttyname(board), "--listen", "127.0.0.1:0"]
start.chefbotd()
"""
"""This daemon tells what is loaded as it writes its first motor command, before or after it is built."""


def test_the_first_stop_is_on_the_wire_before_what_takes_time_is_imported() -> None:
    """No command line, no models, no loop, and less than a quarter of the modules of the daemon that is built."""
    early, late = (
        subprocess.run(
            [sys.executable, "-c", LOADED % is_built],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=True,
        ).stdout.split()
        for is_built in (False, True)
    )
    assert {"click", "pydantic", "asyncio", "serial", "structlog", "numpy"} & set(early) == set()
    assert "chefbotd.link.early_stop" in early
    assert 4 * len(early) < len(late)
    assert "xml.etree.ElementTree" not in late  # nobody has asked for the robot's description


def test_a_daemon_on_a_real_robot_loads_no_simulator_and_nothing_else_that_it_does_not_use() -> None:
    """Until the board is told to stop: no simulator, numpy, images, screens, clients, other formats, recorder."""
    said = subprocess.run(
        [sys.executable, "-c", LOADED % True], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert said.returncode == 0, said.stderr
    loaded = set(said.stdout.split())
    assert {"chefbotd.app", "chefbotd.components.recording.models"} <= loaded
    absent = {
        "chefbotd.client",
        "chefbotd.link.lidar",
        "chefbotd.driving.lidars",
        "chefbotd.safety.scan_guard",
        "numpy",
        "PIL",
        "rich",
        "pygments",
        "yaml",
        "textual",
        "tomlkit",
        "email",
        "zipfile",
        "tempfile",
        "importlib.metadata",
        "importlib.resources",
        "multiprocessing",
        "chefbotd.components.maps.service",
        "chefbotd.components.maps.storage.store",
        "chefbotd.components.recording.encoder",
        "chefbotd.components.recording.chunk_encoder",
        "chefbotd.components.recording.recorder",
        "mcap",
        "zstandard",
        "lz4",
    }
    assert loaded & absent == set()
    simulation = "chefbotd.components.simulation."
    simulator = {
        name
        for name in loaded
        if name.startswith(simulation) and name.removeprefix(simulation) not in ("models", "component")
    }
    assert {name for name in simulator if not name.startswith(f"{simulation}parameters")} == set()


CLOSED = ["<&-", ">&-", "2>&-", "<&- >&-", "<&- 2>&-", ">&- 2>&-", "<&- >&- 2>&-"]


@pytest.mark.parametrize("program", sample(["chefbotd", "chefbotctl"], fast=2))
@pytest.mark.parametrize("closed", sample(CLOSED, fast=2))
def test_a_program_answers_without_standard_streams(program: str, closed: str) -> None:
    """``--version`` and a wrong option, whatever the shell has closed: exit codes 0 and 2, as ever."""
    start = f"exec {sys.executable} -c 'from chefbotd import start; start.{program}()'"
    codes = [
        subprocess.run(["/bin/sh", "-c", f"{start} {option} {closed}"], check=False, capture_output=True)
        for option in ("--version", "--no-such-option")
    ]
    assert [code.returncode for code in codes] == [0, 2]


@pytest.mark.parametrize("closed", sample(CLOSED))
def test_the_daemon_starts_and_ends_in_order_without_standard_streams(closed: str) -> None:
    """SIGTERM, whatever the shell has closed: exit code 0, no abort of libuv, no log that fails."""
    command = (
        f"exec {sys.executable} -m chefbotd.cli.programs.chefbotd run --sim --listen 127.0.0.1:0 {closed}"
    )
    with subprocess.Popen(
        ["/bin/sh", "-c", command],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as process:
        deadline_s = time.monotonic() + PATIENCE_S
        while not _handles_sigterm(process.pid):
            assert time.monotonic() < deadline_s
            time.sleep(0.1)
        process.terminate()
        assert process.wait(timeout=PATIENCE_S) == 0


def _handles_sigterm(pid: int) -> bool:
    """Whether the process has a handler for it (proc(5), SigCgt)."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    caught = int(status.split("SigCgt:\t")[1].split()[0], 16)
    return bool(caught >> (signal.SIGTERM - 1) & 1)
