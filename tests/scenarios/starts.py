"""What is wrong from the beginning: a port with no board on it, and a socket that cannot be guarded as configured.

A robot that does not start must not have moved either: all that was ever written to its motors is zero.
"""

import asyncio
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from structlog.testing import capture_logs

from chefbotd.cli.common.exits import Exit
from chefbotd.client import CallError, Client
from chefbotd.clock import run_virtual
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from tests.scenarios.fault_run import Result
from tests.scenarios.faults.link import GPS, NOT_THE_BOARD
from tests.scenarios.process import PERIOD_S, SPEED_M_S, started
from tests.scenarios.robots import ROBOTS, settings_of
from tests.scenarios.wires import misread

TALKS_FOR_S = 3.0
BOARD_LINES = b"t\t7\t0.02\ne\t0\t0\nu\t57\n" * 2
NOWHERE = "192.0.2.1"
"""An address for examples (RFC 5737): beyond loopback, and no machine's."""


@dataclass(frozen=True, slots=True)
class Silent:
    """A port that says this ten times a second, and is driven all the same; it is told to be ``condition``."""

    row: str
    name: str
    says: bytes
    condition: str
    robots: tuple[str, ...] = ROBOTS


@dataclass(frozen=True, slots=True)
class Refusal:
    """A configuration with which the program does not start: it listens on ``host`` with the tokens in a file.

    ``token_file`` makes that file, or does not, or is None where none is configured. ``says`` is in the log.
    """

    row: str
    name: str
    host: str
    token_file: Callable[[Path], object] | None
    says: str
    robots: tuple[str, ...] = ROBOTS


SILENT = (
    Silent("Nothing on the port", "nothing on the port at the start", b"", "silent"),
    Silent("Nothing on the port", "another device at the start", GPS, "wrong_device"),
    Silent("Wrong baud rate", "wrong baud rate at the start", misread(BOARD_LINES, 1 / 12), "wrong_baud"),
)


def listen(start: Silent, robot_name: str) -> Result:
    """Let a fresh daemon listen to it, on the virtual clock."""
    wrong: list[str] = []
    device = FakeSerialDevice()

    async def run() -> None:
        async with running_daemon(device, settings_of(robot_name, {})) as client:
            for _ in range(round(TALKS_FOR_S / 0.1)):
                device.feed(start.says)
                await _drive(client)
                await asyncio.sleep(0.1)
            link = (await client.call("get_state"))["topics"]["link"]["data"]
            if (link["healthy"], link["condition"]) != (False, start.condition):
                wrong.append(f"told as {link['condition']}")

    with capture_logs() as log:
        run_virtual(run())
    if not any(entry["event"] == NOT_THE_BOARD for entry in log):
        wrong.append(f"log has no {NOT_THE_BOARD!r}")
    if moving := [line for line in bytes(device.written).split(b"\r") if line.strip(b"s 0")]:
        wrong.append(f"wrote {moving[0]!r}")
    return Result(robot_name, start.name, None, None, None, 0, 0, tuple(wrong))


async def _drive(client: Client) -> None:
    try:
        await client.drive(SPEED_M_S, 0.0)
    except CallError as refusal:
        if refusal.kind not in ("link_down", "disarmed"):
            raise


def _readable_by_all(path: Path) -> None:
    path.write_text("admin " + "a" * 32)
    path.chmod(0o644)


NO_TOKEN, BAD_FILE = "Beyond loopback without a token", "Token file missing"

REFUSALS = (
    Refusal(NO_TOKEN, "beyond loopback without a token", NOWHERE, None, "set api.token_file"),
    Refusal(BAD_FILE, "token file missing", "127.0.0.1", lambda path: None, "openssl rand"),
    Refusal(BAD_FILE, "token file open to others", "127.0.0.1", _readable_by_all, "chmod 600"),
)


def start(refusal: Refusal, robot_name: str) -> Result:
    """Let the real program try."""
    with tempfile.TemporaryDirectory(prefix="chefbotd-faults-") as folder:
        return asyncio.run(_started(refusal, robot_name, Path(folder)))


async def _started(refusal: Refusal, robot_name: str, folder: Path) -> Result:
    environment = ""
    if refusal.token_file is not None:
        refusal.token_file(folder / "tokens")
        environment = f"import os; os.environ['CHEFBOTD_API__TOKEN_FILE'] = {str(folder / 'tokens')!r}"
    wrong = []
    async with started(folder, environment, robot_name, refusal.host) as program:
        code = await program.ended()
        said = program.log.read_text()
        await asyncio.sleep(PERIOD_S)
    if code != Exit.BAD_CONFIGURATION:
        wrong.append(f"exit code {code}")
    if refusal.says not in said:
        wrong.append(f"does not say {refusal.says!r}")
    if program.board.heard:
        wrong.append(f"wrote {program.board.heard[0]}")
    return Result(robot_name, refusal.name, None, None, None, 0, 0, tuple(wrong))
