"""Keeping the link open."""

import asyncio
import random

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.events import LinkClosed, LinkHealthChanged, LinkNotOpened, LinkOpened
from chefbotd.link.cannot_open import Sharers
from chefbotd.link.port import LinkParameters
from chefbotd.link.reconnect import PortLink, waits_s
from chefbotd.link.session import BoardSession
from chefbotd.testing.transport import FakeSerialDevice
from firmware_protocol.codec import CLASSIC

PARAMETERS = LinkParameters(reconnect_delay_s=0.1, max_reconnect_delay_s=1.0, reconnect_jitter=0.2)


def test_waits_double_up_to_the_longest_and_vary():
    """0.1, 0.2, 0.4, 0.8, 1.0, 1.0 s, each within 20 % of that, and not all exactly on it."""
    waits = waits_s(PARAMETERS, random.Random(1))
    got = [next(waits) for _ in range(6)]
    nominal = [0.1, 0.2, 0.4, 0.8, 1.0, 1.0]
    assert got == [pytest.approx(n, rel=0.2) for n in nominal]
    assert got != pytest.approx(nominal, rel=1e-3)


def run_link(device: FakeSerialDevice, story) -> tuple[list[type], bytes]:
    """Run a link while ``story`` happens; returns the link events and everything written to the device."""

    async def scenario() -> list[type]:
        bus = Bus()
        inbox = bus.subscribe(LinkOpened, LinkClosed)
        session = BoardSession(bus, LoopClock(), CLASSIC, device="fake", setpoints_per_s=200.0)
        link = PortLink(PARAMETERS, session, device.open, LoopClock(), random.Random(1))
        task = asyncio.create_task(link.run())
        await story(session)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return [type(inbox.take_event()) for _ in range(len(inbox))]

    return run_virtual(scenario()), bytes(device.written)


def test_a_device_that_comes_late_is_opened_when_it_comes():
    """Absent for 3 s at the start, then plugged: opened within one longest wait."""
    device = FakeSerialDevice(plugged=False)

    async def story(session: BoardSession) -> None:
        await asyncio.sleep(3.0)
        assert not session.is_open
        device.plug()
        await asyncio.sleep(1.2)
        assert session.is_open

    assert run_link(device, story)[0] == [LinkOpened, LinkClosed]


def test_a_lost_link_comes_back_by_itself():
    """Unplugged and plugged again: told both times, and the first line after it is a stop."""
    device = FakeSerialDevice()

    async def story(session: BoardSession) -> None:
        await asyncio.sleep(1.0)
        device.unplug()
        await asyncio.sleep(1.0)
        device.written.clear()
        device.plug()
        await asyncio.sleep(1.2)
        assert bytes(device.written) == 2 * b"s 0 0\r"

    assert run_link(device, story)[0] == [LinkOpened, LinkClosed, LinkOpened, LinkClosed]


def test_ending_the_link_stops_the_motors_and_closes_the_port():
    """Cancelled with the motors on: the last line is a stop and the port is given up."""
    device = FakeSerialDevice()

    async def story(session: BoardSession) -> None:
        await asyncio.sleep(1.0)
        session.send_duty((100, 100))

    kinds, written = run_link(device, story)
    assert kinds == [LinkOpened, LinkClosed]
    assert written == 2 * b"s 0 0\r" + b"s 100 100\r" + 4 * b"s 0 0\r"


@pytest.mark.parametrize(
    ("opening_s", "written"),
    [(0.5, 6 * b"s 0 0\r"), (60.0, b"")],
    ids=["opens in the end", "does not open"],
)
def test_an_end_while_the_port_opens_leaves_a_stop_there(opening_s: float, written: bytes):
    """Cancelled between the opening and its being known: the board is told to stop, if the port opens within 2 s."""
    device = FakeSerialDevice()

    async def open_slowly(parameters: LinkParameters, session: asyncio.BaseProtocol) -> asyncio.Transport:
        await asyncio.sleep(opening_s)
        return await device.open(parameters, session)

    async def scenario() -> float:
        session = BoardSession(Bus(), LoopClock(), CLASSIC, device="fake", setpoints_per_s=200.0)
        link = PortLink(PARAMETERS, session, open_slowly, LoopClock(), random.Random(1))
        task = asyncio.create_task(link.run())
        await asyncio.sleep(0.1)
        before_s = LoopClock().now_s()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        took_s = LoopClock().now_s() - before_s
        await asyncio.sleep(100.0)
        return took_s

    assert run_virtual(scenario()) == pytest.approx(min(opening_s - 0.1, 2.0))
    assert bytes(device.written) == written


def test_a_device_that_stays_away_is_mentioned_once_a_minute(capsys: pytest.CaptureFixture[str]):
    """Ten minutes without a device are ten or eleven log lines, not six hundred."""
    device = FakeSerialDevice(plugged=False)

    async def story(session: BoardSession) -> None:
        await asyncio.sleep(600.0)

    run_link(device, story)
    assert 10 <= capsys.readouterr().out.count("link cannot be opened") <= 11


def opens_in_a_minute(said: bytes) -> int:
    """How often a port is opened that says this and closes at once, as a server may that accepts and closes."""
    device, opens = FakeSerialDevice(), 0

    async def open_and_close(parameters: LinkParameters, session: asyncio.BaseProtocol) -> asyncio.Transport:
        nonlocal opens
        opens += 1
        transport = await device.open(parameters, session)
        asyncio.get_running_loop().call_soon(lambda: (device.feed(said), transport.abort()))
        return transport

    async def scenario() -> None:
        session = BoardSession(Bus(), LoopClock(), CLASSIC, device="fake", setpoints_per_s=200.0)
        link = PortLink(PARAMETERS, session, open_and_close, LoopClock(), random.Random(1))
        task = asyncio.create_task(link.run())
        await asyncio.sleep(60.0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run_virtual(scenario())
    return opens


@pytest.mark.parametrize("said", [b"", b"hello\r\n"])
def test_a_port_that_opens_and_closes_is_tried_ever_more_rarely(said: bytes):
    """Waits of 0.1, 0.2, 0.4, 0.8 and then 1 s each: 1.5 s for the first four, and 58 to follow, within the jitter."""
    assert 58 <= opens_in_a_minute(said) <= 68


def test_a_board_that_has_spoken_is_opened_again_soon():
    """A good line each time, then the link is lost: every wait is the first one, 0.1 s, so 600 in a minute."""
    assert 570 <= opens_in_a_minute(b"u\t12\n") <= 630


def test_why_a_device_cannot_be_opened_is_told_once_for_each_reason():
    """Ten minutes without a device are one event; a device that is lost and stays away is told anew."""
    device = FakeSerialDevice(plugged=False)

    async def scenario() -> list[object]:
        bus = Bus()
        inbox = bus.subscribe(LinkNotOpened, LinkOpened, size=100)
        session = BoardSession(bus, LoopClock(), CLASSIC, device="fake", setpoints_per_s=200.0)
        link = PortLink(PARAMETERS, session, device.open, LoopClock(), random.Random(1))
        task = asyncio.create_task(link.run())
        await asyncio.sleep(600.0)
        device.plug()
        await asyncio.sleep(2.0)
        device.unplug()
        await asyncio.sleep(600.0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return [inbox.take_event() for _ in range(len(inbox))]

    told = run_virtual(scenario())
    assert [type(event) for event in told] == [LinkNotOpened, LinkOpened, LinkNotOpened]
    assert [event.device for event in told] == ["fake"] * 3
    assert told[0].reason == "could not open port /dev/ttyACM0: no such device"


@pytest.mark.parametrize(
    ("line", "loses"), [(b"u\t120\n", True), (b"u\t1\xf00\n", False)], ids=["link lost", "lines damaged"]
)
def test_a_second_reader_of_the_port_is_named_until_it_is_gone(line: bytes, loses: bool):
    """It is looked for when the link is lost, and where lines are refused: the link's condition says who it is."""
    told: list[tuple[str, str]] = []
    readers = ["minicom (pid 7) has it open too"]

    async def scenario() -> None:
        bus, device = Bus(), FakeSerialDevice()
        bus.add_handler(lambda event: told.append((event.condition, event.reason)), LinkHealthChanged)
        session = BoardSession(bus, LoopClock(), CLASSIC, device="fake", setpoints_per_s=200.0)
        link = PortLink(
            PARAMETERS,
            session,
            device.open,
            LoopClock(),
            random.Random(1),
            sharers_of=lambda path: Sharers(seen=readers[0]),
        )
        task = asyncio.create_task(link.run())
        await asyncio.sleep(0.1)
        for half in range(2):
            for _ in range(200):
                device.feed(b"e\t0\t0\nu\t120\n" if half else b"e\t0\t0\n" + line)
                await asyncio.sleep(0.05)
            if loses and not half:
                device.unplug()
                device.plug()
                await asyncio.sleep(1.0)
                for _ in range(60):
                    device.feed(b"e\t0\t0\n" + line)
                    await asyncio.sleep(0.05)
            readers[0] = ""
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run_virtual(scenario())
    shared = ("shared_port", "minicom (pid 7) has it open too")
    assert told[-2:] == [shared, ("healthy", "")]
    assert told.count(shared) == 1


def test_nobody_is_looked_for_while_all_is_well():
    """The look through all processes costs time: a link without trouble is not worth it."""
    looks: list[str] = []

    async def scenario() -> None:
        device = FakeSerialDevice()
        session = BoardSession(Bus(), LoopClock(), CLASSIC, device="fake", setpoints_per_s=200.0)

        def find(path: str) -> Sharers:
            looks.append(path)
            return Sharers()

        link = PortLink(PARAMETERS, session, device.open, LoopClock(), random.Random(1), sharers_of=find)
        task = asyncio.create_task(link.run())
        await asyncio.sleep(0.1)
        for _ in range(600):
            device.feed(b"e\t0\t0\nu\t120\n")
            await asyncio.sleep(0.05)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run_virtual(scenario())
    assert looks == []
