"""A stop past the loop: the session's and the port's part of the watchdog's intervention, on a real pty."""

import asyncio
import os
import threading

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import SystemClock
from chefbotd.link.port import LinkParameters, open_port
from chefbotd.link.session import BoardSession
from chefbotd.testing.transport import FakeSerialDevice
from firmware_protocol.codec import CLASSIC
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.realtime


def new_session(setpoints_per_s: float = 200.0) -> BoardSession:
    """A session without a port."""
    return BoardSession(Bus(), SystemClock(), CLASSIC, device="pty", setpoints_per_s=setpoints_per_s)


STOP = b"s 0 0\rs 0 0\r"


async def heard(master: int, line: bytes) -> bool:
    """Whether this, and nothing else, arrives: the kernel takes its time to bring it."""
    arrived = b""
    async with asyncio.timeout(PATIENCE_S):
        while len(arrived) < len(line):
            await asyncio.sleep(0.01)
            arrived += drained(master)
    return arrived == line


def drained(master: int) -> bytes:
    """All that the board has been sent so far."""
    os.set_blocking(master, False)
    try:
        return os.read(master, 65536)
    except BlockingIOError:
        return b""


def test_a_thread_stops_the_motors_while_the_loop_stands_still():
    """The loop is held up by a sleep; the zeros are on the wire all the same, and a duty that waited is withdrawn."""

    async def run() -> None:
        master, slave = os.openpty()
        session = new_session(setpoints_per_s=0.001)
        session.expect_connection()
        transport = await open_port(LinkParameters(device=os.ttyname(slave)), session)
        await asyncio.sleep(0.01)
        for duty in (200, 201, 202):
            session.send_duty((duty, duty))
        assert await heard(master, STOP + b"s 200 200\rs 201 201\r")  # the third waits for its time
        stopped: list[bool] = []
        thread = threading.Thread(target=lambda: stopped.append(session.stop_from_thread()))
        thread.start()
        thread.join()  # the loop stands still
        assert stopped == [True]
        assert await heard(master, STOP)
        session.setpoints.resume()  # as its timer does when the time has come
        assert session.stop_from_thread()
        assert await heard(master, STOP)
        transport.abort()
        await session.wait_closed()
        os.close(master)
        os.close(slave)

    asyncio.run(run())


def test_a_board_that_takes_nothing_is_told():
    """The kernel's buffer is full: the stop did not go; it does once there is room."""

    async def run() -> None:
        master, slave = os.openpty()
        session = new_session()
        session.expect_connection()
        transport = await open_port(LinkParameters(device=os.ttyname(slave)), session)
        await asyncio.sleep(0.01)
        stops = 1
        while session.stop_from_thread():
            stops += 1
        told = b""

        def goes_once_there_is_room() -> bool:
            nonlocal told
            told += drained(master)
            return session.stop_from_thread()

        wait_until(
            goes_once_there_is_room
        )  # which the kernel makes in its own time; the loop must not write meanwhile
        async with asyncio.timeout(PATIENCE_S):
            while len(told) < stops * len(STOP) or not told.endswith(STOP):
                await asyncio.sleep(0.01)
                told += drained(master)
        transport.abort()
        while drained(master):
            pass
        await session.wait_closed()
        os.close(master)
        os.close(slave)

    asyncio.run(run())


def test_without_a_serial_port_there_is_nothing_to_stop():
    """No port, or one that has no descriptor of its own: the answer is no."""

    async def run() -> None:
        session = new_session()
        assert not session.stop_from_thread()
        await FakeSerialDevice().open(LinkParameters(), session)
        await asyncio.sleep(0)
        assert not session.stop_from_thread()

    asyncio.run(run())
