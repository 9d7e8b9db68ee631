"""The link on real pseudo-terminals under uvloop: pulled, put back, elsewhere, twice."""

import asyncio
import contextlib
import os
import random
import sys
import tty
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path

import pytest
import uvloop

from chefbotd.bus import Bus
from chefbotd.clock import SystemClock
from chefbotd.link.port import BriefSerial, LinkParameters, open_port
from chefbotd.link.reconnect import PortLink
from chefbotd.link.session import BoardSession
from firmware_protocol.codec import CLASSIC
from tests.waiting import PATIENCE_S, until

pytestmark = pytest.mark.realtime

CYCLES = 100
OPENING = b"s 0 0\rs 0 0\r"


class Cable:
    """A stable name, as udev makes it, for ptys that come and go under names of their own."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.masters: list[int] = []
        self.names: list[str] = []

    def plug(self) -> None:
        """A new device behind the stable name."""
        master, slave = os.openpty()
        tty.setraw(slave)
        self.masters.append(master)
        self.names.append(os.ttyname(slave))
        os.close(slave)
        fresh = self.path.with_suffix(".new")
        fresh.symlink_to(self.names[-1])
        fresh.replace(self.path)

    def unplug(self) -> None:
        """The newest device is gone, its name too."""
        self.path.unlink()
        os.close(self.masters.pop())

    def read(self) -> bytes:
        """What the newest device was told first."""
        told = b""
        while len(told) < len(OPENING):
            told += os.read(self.masters[-1], 4096)
        return told


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[Cable]:
    """A cable that is plugged in; what a test leaves open is closed."""
    made = Cable(tmp_path / "board")
    made.plug()
    yield made
    for master in made.masters:
        os.close(master)


def on_link(cable: Cable, story: Callable[[BoardSession], Awaitable[None]]) -> None:
    """Keep a link to the cable open under uvloop while a story happens."""

    async def run() -> None:
        parameters = LinkParameters(
            device=str(cable.path), reconnect_delay_s=0.002, max_reconnect_delay_s=0.004
        )
        session = BoardSession(Bus(), SystemClock(), CLASSIC, device=parameters.device, setpoints_per_s=200.0)
        link = PortLink(parameters, session, open_port, SystemClock(), random.Random(1))
        task = asyncio.create_task(link.run())
        await story(session)
        task.cancel()
        await asyncio.wait([task])

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(asyncio.wait_for(run(), timeout=2 * PATIENCE_S))


async def settled() -> None:
    """Let the tasks end that are at their end."""
    for _ in range(10):
        await asyncio.sleep(0)


def held() -> tuple[int, int]:
    """Descriptors and tasks of this process."""
    return len(list(Path("/proc/self/fd").iterdir())), len(asyncio.all_tasks())


def test_a_hundred_replugs_leak_nothing(cable: Cable):
    """After a hundred pulls of the cable there are as many descriptors and tasks as after the first; each got a stop."""

    async def story(session: BoardSession) -> None:
        await until(lambda: session.is_open)
        await settled()
        before = held()
        for number in range(CYCLES):
            assert cable.read() == OPENING
            cable.unplug()
            await until(lambda: not session.is_open)
            cable.plug()
            await until(lambda opens=number + 2: session.memory.opens == opens)
        await until(lambda: held() == before)

    on_link(cable, story)


def test_the_device_comes_back_under_another_name(cable: Cable):
    """While the old name is taken the new device has another one; the stable name leads to it."""

    async def story(session: BoardSession) -> None:
        await until(lambda: session.is_open)
        cable.unplug()
        await until(lambda: not session.is_open)
        taken = os.openpty()
        cable.plug()
        await until(lambda: session.is_open)
        assert cable.names[0] != cable.names[1]
        assert cable.read() == OPENING
        for descriptor in taken:
            os.close(descriptor)

    on_link(cable, story)


def test_pulled_while_it_does_not_read_it_comes_back(cable: Cable):
    """A device full of unread bytes is pulled: the link is lost all the same, and opened again."""

    async def story(session: BoardSession) -> None:
        await until(lambda: session.is_open)
        number = 0
        while not session.setpoints.replaced:
            number += 1
            session.send_duty((number % 1000, 1))
            await asyncio.sleep(0 if number % 100 else 0.005)
        cable.unplug()
        await until(lambda: not session.is_open)
        cable.plug()
        await until(lambda: session.memory.opens == 2)
        assert cable.read() == OPENING

    on_link(cable, story)


def test_a_device_in_use_is_refused_by_its_owners_name(cable: Cable):
    """Another process has the device: the error names the device, the program and the pid."""
    hold = "import serial, sys; port = serial.Serial(sys.argv[1], exclusive=True); print('ready', flush=True); input()"

    async def story() -> None:
        other = await asyncio.create_subprocess_exec(
            sys.executable, "-c", hold, str(cable.path), stdin=-1, stdout=-1
        )
        assert other.stdout is not None
        await other.stdout.readline()
        with pytest.raises(OSError, match=rf"^{cable.path}: in use by \S+ \(pid {other.pid}\)$"):
            await open_port(LinkParameters(device=str(cable.path)), asyncio.Protocol())
        await other.communicate(b"\n")

    asyncio.run(asyncio.wait_for(story(), timeout=PATIENCE_S))


def test_a_file_that_is_no_device_is_an_error_that_names_it(tmp_path: Path):
    """A plain file cannot be set up as a port: an OSError like any other."""
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(OSError, match=str(file)):
        asyncio.run(open_port(LinkParameters(device=str(file)), asyncio.Protocol()))


def test_flushing_a_lost_device_is_harmless(cable: Cable):
    """The cable is out: there is nothing to flush and nothing to wait for."""
    port = BriefSerial(str(cable.path))
    port.flush()
    cable.unplug()
    port.flush()
    with contextlib.suppress(OSError):
        port.close()
