"""What systemd's watchdog is told, beside a reader and a control loop that make progress or not."""

import asyncio
import os
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest
import serial

from chefbotd.clock import run_virtual
from chefbotd.link.port import SerialPortTransport
from chefbotd.process.keep_alive import KeepAlive, watchdog_s_of
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.waiting import wait_until

FED = "WATCHDOG=1"


@dataclass
class Robot:
    """A control loop that acts whenever it is told to, and a reader of bytes."""

    acted_s: float = 0.0
    bytes_in: int = 0
    unread: int = 0
    told: list[str] = field(default_factory=list)
    status: str = "armed; 2 clients"

    def unread_bytes(self) -> int:
        """What waits."""
        return self.unread

    def keep_alive(self, watchdog_s: float | None = 5.0) -> KeepAlive:
        """What is tested."""
        return KeepAlive(self, self, self.told.append, lambda: self.status, watchdog_s)


def test_the_status_is_told_once_and_the_watchdog_is_fed_at_every_look():
    """A status line goes out when it changes; the watchdog's word each time something has happened."""
    robot = Robot()
    keep_alive = robot.keep_alive()
    for acted_s in (0.02, 1.02):
        robot.acted_s = acted_s
        keep_alive.beat()
    robot.acted_s, robot.status = 2.02, "estopped; 1 client"
    keep_alive.beat()
    assert robot.told == [f"STATUS=armed; 2 clients\n{FED}", FED, f"STATUS=estopped; 1 client\n{FED}"]


def test_a_control_loop_that_takes_no_step_is_not_vouched_for():
    """Its reader goes on: what it did last is as it was at the last look, and the word is kept back until it moves."""
    robot = Robot(acted_s=7.0)
    keep_alive = robot.keep_alive()
    keep_alive.beat()
    robot.bytes_in = 700
    keep_alive.beat()
    assert robot.told == [f"STATUS=armed; 2 clients\n{FED}"]
    robot.acted_s = 7.5
    keep_alive.beat()
    assert robot.told[1:] == [FED]


@pytest.mark.parametrize(
    ("unread", "read", "fed"),
    [
        pytest.param((130, 260), 0, False, id="bytes wait and nobody reads"),
        pytest.param((130, 260), 90, True, id="more come than are read"),
        pytest.param((0, 260), 0, True, id="bytes have come since the last look"),
        pytest.param((0, 0), 0, True, id="a board that says nothing"),
    ],
)
def test_a_reader_is_stuck_when_bytes_wait_at_two_looks_and_none_was_read(
    unread: tuple[int, int], read: int, fed: bool
):
    """The control loop goes on all the while: a stuck reader alone keeps the word back."""
    robot = Robot(acted_s=1.0, unread=unread[0])
    keep_alive = robot.keep_alive()
    keep_alive.beat()
    robot.acted_s, robot.unread, robot.bytes_in = 2.0, unread[1], read
    keep_alive.beat()
    assert [word for word in robot.told[1:] if FED in word] == ([FED] if fed else [])


def test_without_a_watchdog_only_the_status_is_told():
    """WatchdogSec= is not set: nobody waits for the word."""
    robot = Robot()
    keep_alive = robot.keep_alive(watchdog_s=None)
    robot.acted_s = 1.0
    keep_alive.beat()
    assert robot.told == ["STATUS=armed; 2 clients"]


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({}, None),
        ({"WATCHDOG_USEC": "5000000"}, 5.0),
        ({"WATCHDOG_USEC": "2500000", "WATCHDOG_PID": str(os.getpid())}, 2.5),
        ({"WATCHDOG_USEC": "2500000", "WATCHDOG_PID": "1"}, None),
        ({"WATCHDOG_USEC": "0"}, None),
        ({"WATCHDOG_USEC": "soon"}, None),
    ],
)
def test_the_watchdogs_time_is_read_as_sd_watchdog_enabled_reads_it(
    environment: dict[str, str], expected: float | None
):
    """Microseconds, for this process or for any; anything else is no watchdog."""
    assert watchdog_s_of(environment) == expected


def fed_within(robot: SimulatedRobot, told: list[str]) -> int:
    """How often the watchdog was fed so far."""
    return sum(FED in word for word in told)


def test_the_daemon_is_vouched_for_until_its_reader_or_its_control_is_stuck_and_with_its_cable_pulled():
    """The whole daemon, WatchdogSec=2: a word each 0.5 s, also without a board; none while either is stuck."""

    async def scenario() -> None:
        async with simulated_robot() as robot:
            told: list[str] = []
            session, driving = robot.daemon.session, robot.daemon.driving
            keep_alive = KeepAlive(driving, session, told.append, str, 2.0)
            running = asyncio.create_task(keep_alive.run())
            await asyncio.sleep(2.1)
            assert fed_within(robot, told) == 4

            robot.device.unplug()
            told.clear()
            await asyncio.sleep(3.0)
            assert fed_within(robot, told) == 6
            robot.device.plug()
            await asyncio.sleep(3.0)
            assert session.is_open

            transport = robot.device.transport
            assert transport is not None
            stuck, transport.feed = transport.feed, lambda data: None
            transport.unread = 4095
            await asyncio.sleep(1.0)
            told.clear()
            await asyncio.sleep(3.0)
            assert fed_within(robot, told) == 0
            transport.feed, transport.unread = stuck, 0
            await asyncio.sleep(1.0)
            assert fed_within(robot, told) > 0

            driving.detach()
            driving._watch_timer.stop()
            await asyncio.sleep(1.0)
            told.clear()
            await asyncio.sleep(3.0)
            assert fed_within(robot, told) == 0
            running.cancel()

    run_virtual(scenario())


@contextmanager
def pty() -> Iterator[tuple[int, serial.Serial]]:
    """The board's end of a pty, and a serial port on the other."""
    board, host = os.openpty()
    tty.setraw(host)
    try:
        with serial.Serial(os.ttyname(host)) as port:
            os.close(host)
            yield board, port
    finally:
        os.close(board)


def test_a_serial_port_says_how_many_bytes_wait():
    """Seven bytes that nobody reads, on a real pty; none any more once the device is gone."""

    async def scenario() -> None:
        with pty() as (board, port):
            transport = SerialPortTransport(asyncio.get_running_loop(), asyncio.Protocol(), port)
            await asyncio.sleep(0.01)  # it reads from now on
            os.write(board, b"e\t1\t2\r\n")
            wait_until(
                lambda: transport.unread_bytes() == 7
            )  # by the kernel; the loop reads nothing meanwhile
            transport.abort()
            await asyncio.sleep(0)
            assert transport.unread_bytes() == 0
            wait_until(lambda: not port.is_open)  # a thread closes it, and nobody else may meanwhile

    asyncio.run(scenario())
