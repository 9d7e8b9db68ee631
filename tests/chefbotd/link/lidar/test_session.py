"""A lidar's link on the virtual clock: scans on the bus, its health in words, unplugging, and the motor at the end."""

import asyncio
import math
import random
from collections.abc import Awaitable, Callable, Iterable

import numpy as np
import pytest

from chefbotd.bus import Bus, Inbox
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.events import OdometryUpdated
from chefbotd.core.events.lidars import LidarChanged, ScanMeasured
from chefbotd.core.geometry import Pose2D, PoseCovariance, Twist2D
from chefbotd.link.lidar.session import LidarSession, port_of
from chefbotd.link.reconnect import PortLink
from chefbotd.sensing.lidar import LidarParameters
from chefbotd.testing.transport import FakeSerialDevice
from firmware_protocol.lidar.rplidar import EXPRESS_SCAN, HealthStatus, RequestCode
from tests.fakes.lidar import FakeRplidar, ld19_bytes, ld19_packets, noisy_box, stalled_ld19_packets

MOUNT = {"mount_x_m": 0.11, "mount_y_m": -0.07, "mount_yaw_rad": 0.7}
LD19 = LidarParameters.model_validate({"name": "top", "model": "ld19", "device": "/dev/lidar", **MOUNT})
A1 = LidarParameters.model_validate({"name": "low", "model": "rplidar_a1", "device": "/dev/lidar"})


class Rig:
    """A session on its link, what it published, and the device at the other end."""

    def __init__(self, lidar: LidarParameters) -> None:
        self.bus, self.device = Bus(), FakeSerialDevice()
        self.scans: Inbox[ScanMeasured] = self.bus.subscribe(ScanMeasured)
        self.changes: Inbox[LidarChanged] = self.bus.subscribe(LidarChanged)
        self.session = LidarSession(self.bus, LoopClock(), lidar)
        self.opened: list[object] = []
        self.link = PortLink(port_of(lidar), self.session, self.open, LoopClock(), random.Random(1))

    async def open(self, parameters: object, protocol: asyncio.BaseProtocol) -> asyncio.Transport:
        """Open the fake device."""
        self.opened.append(parameters)
        return await self.device.open(parameters, protocol)  # type: ignore[arg-type]

    async def feed(self, chunks: Iterable[tuple[float, bytes]], seconds: float) -> None:
        """Feed what is timed, for so long, at its own pace."""
        begin_s = LoopClock().now_s()
        for at_s, data in chunks:
            if at_s > seconds:
                return
            await asyncio.sleep(max(0.0, begin_s + at_s - LoopClock().now_s()))
            self.device.feed(data)

    async def drive(self, linear_m_s: float) -> None:
        """Publish odometry of a robot that drives, 20 times a second, until cancelled."""
        while True:
            now_s = LoopClock().now_s()
            self.bus.publish(
                OdometryUpdated(now_s, now_s, Pose2D(), Twist2D(linear_m_s, 0.0), PoseCovariance())
            )
            await asyncio.sleep(0.05)

    def told(self) -> list[tuple[str, bool | None, str]]:
        """What was told of the lidar since the last look: condition, whether healthy, reason."""
        found = []
        while len(self.changes):
            event = self.changes.take_event()
            assert (event.lidar, event.device) == (self.session.lidar.name, "/dev/lidar")
            assert event.is_open == (event.condition != "down")
            found.append((event.condition, event.healthy, event.reason))
        return found


def run(lidar: LidarParameters, story: Callable[[Rig], Awaitable[None]]) -> Rig:
    """Run a lidar's link while the story happens, and end it."""

    async def scenario() -> Rig:
        rig = Rig(lidar)
        task = asyncio.create_task(rig.link.run())
        await asyncio.sleep(0.01)
        await story(rig)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return rig

    return run_virtual(scenario())


def test_an_ld19_s_turns_are_scans_on_the_bus() -> None:
    """In 2 s 19 whole turns of 450 beams: lidar, mount and stamp with them, the wall at the left 1 m away."""

    async def story(rig: Rig) -> None:
        await rig.feed(ld19_packets(noisy_box()), 2.0)

    rig = run(LD19, story)
    assert len(rig.scans) == 19
    event = rig.scans.take_event()
    assert (event.lidar, event.base_from_lidar) == ("top", Pose2D(0.11, -0.07, 0.7))
    assert event.stamp_s == event.scan.stamp_s
    left = np.argmin(abs((event.scan.bearing_rad - math.pi / 2) % math.tau))
    assert event.scan.range_m[left] == pytest.approx(1.0, abs=0.03)
    assert [condition for condition, *_ in rig.told()] == ["unknown", "healthy", "down"]
    assert rig.session.memory.turn_s == pytest.approx(0.1, abs=0.003)
    assert rig.opened[0].baud == 230_400  # type: ignore[attr-defined]


def timed(chunk: bytes, every_s: float = 0.01) -> Iterable[tuple[float, bytes]]:
    """The same bytes over and over."""
    return ((index * every_s, chunk) for index in range(100_000))


def frozen() -> Iterable[tuple[float, bytes]]:
    """150 packets of an LD19, four turns, replayed again and again."""
    packets = ld19_bytes(noisy_box(), 150)
    for index in range(100_000):
        yield index / 375, packets[index % 150]


@pytest.mark.parametrize(
    ("chunks", "condition", "told"),
    [
        ((), "silent", "nothing received for 2.0 s: does the lidar have power"),
        (timed(b"\x8f\x01\xfe\x30"), "wrong_baud", "is the baud rate right (LD06, LD19: 230400;"),
        (timed(b"e\t12\t13\r\n"), "wrong_device", "this is text: is this the port of the board?"),
        (
            timed(b"\xa5\x5a\x05\x00\x00\x40\x81"),
            "wrong_device",
            "this may be an RPLIDAR: is the model right?",
        ),
        (stalled_ld19_packets(2000), "motor_stalled", "packets but no whole turn: does its motor turn?"),
    ],
    ids=["silent", "garbage", "text", "an RPLIDAR", "stalled"],
)
def test_what_an_ld19_s_port_sounds_like_is_told(
    chunks: Iterable[tuple[float, bytes]], condition: str, told: str
) -> None:
    """After two seconds, with what was heard and what it suggests; nothing is published as a scan."""

    async def story(rig: Rig) -> None:
        await rig.feed(chunks, 2.4)
        await asyncio.sleep(2.4)

    rig = run(LD19, story)
    (_, judged, *_) = rig.told()
    assert judged[:2] == (condition, False)
    assert told in judged[2]
    assert len(rig.scans) == 0


def test_an_ld19_where_an_rplidar_is_configured_is_told() -> None:
    """Its packets are known."""

    async def story(rig: Rig) -> None:
        await rig.feed(ld19_packets(noisy_box()), 2.4)

    (_, judged, *_) = run(A1, story).told()
    assert judged[0] == "wrong_device"
    assert "these are packets of an LD06 or LD19" in judged[2]


def test_bytes_that_are_replayed_are_no_scans() -> None:
    """Four turns over and over while the robot creeps ahead: those of before are counted, told, and not published."""

    async def story(rig: Rig) -> None:
        driving = asyncio.create_task(rig.drive(0.2))
        await rig.feed(frozen(), 20.0)
        driving.cancel()

    rig = run(LD19, story)
    assert len(rig.scans) <= 4
    assert rig.session.memory.repeated > 10
    assert rig.session.refused["repeated_turn"] == rig.session.memory.repeated
    conditions = [condition for condition, *_ in rig.told()]
    assert conditions[:2] == ["unknown", "healthy"]
    assert "frozen" in conditions


def test_a_lidar_that_falls_silent_and_comes_back_is_told_both_times() -> None:
    """Without a new connection."""

    async def story(rig: Rig) -> None:
        await rig.feed(ld19_packets(noisy_box()), 1.0)
        await asyncio.sleep(5.0)
        await rig.feed(ld19_packets(noisy_box(2)), 1.5)

    conditions = [condition for condition, *_ in run(LD19, story).told()]
    assert conditions == ["unknown", "healthy", "silent", "healthy", "down"]


def test_an_unplugged_lidar_is_opened_again_by_itself() -> None:
    """Scans stop with the cable and come back with it, and the session's counters go on."""

    async def story(rig: Rig) -> None:
        await rig.feed(ld19_packets(noisy_box()), 1.0)
        rig.device.unplug()
        await asyncio.sleep(5.0)
        before = rig.session.memory.scans
        rig.device.plug()
        for _ in range(60):
            await asyncio.sleep(0.0 if rig.session.is_open else 0.05)
        await rig.feed(ld19_packets(noisy_box(7)), 1.0)
        assert rig.session.memory.scans == before + 9

    rig = run(LD19, story)
    assert rig.session.memory.opens == 2
    told = rig.told()
    assert [condition for condition, *_ in told] == [
        "unknown",
        "healthy",
        "down",
        "down",
        "unknown",
        "healthy",
        "down",
    ]
    assert "no such device" in told[3][2]


def connected(device: FakeRplidar, rig: Rig) -> None:
    """Put the fake RPLIDAR behind the fake port."""
    rig.device.on_write = device.receive
    device.sent = lambda data: asyncio.get_running_loop().call_soon(rig.device.feed, data)


async def turning(device: FakeRplidar, seconds: float) -> None:
    """Let the device live."""
    for _ in range(round(seconds * 100)):
        device.turn()
        await asyncio.sleep(0.01)


def test_an_rplidar_is_asked_started_and_stopped() -> None:
    """DTR is off while it is open, so that the A1's motor turns; at the end STOP is written and DTR set."""
    device = FakeRplidar(noisy_box())
    transports = []

    async def story(rig: Rig) -> None:
        connected(device, rig)
        await turning(device, 2.0)
        transports.append(rig.device.transport)

    rig = run(A1, story)
    assert len(rig.scans) > 10
    assert device.requests == [RequestCode.GET_INFO, RequestCode.GET_HEALTH, EXPRESS_SCAN, RequestCode.STOP]
    assert rig.opened[0].dtr is False  # type: ignore[attr-defined]
    assert transports[0].dtr is True
    assert [condition for condition, *_ in rig.told()] == ["unknown", "healthy", "down"]


def test_an_rplidar_that_answers_and_does_not_turn_has_a_stalled_motor() -> None:
    """It says what it is, is asked for a scan, and nothing comes."""
    device = FakeRplidar(noisy_box())
    device.motor_turns = False

    async def story(rig: Rig) -> None:
        connected(device, rig)
        await turning(device, 2.4)

    (_, judged, *_) = run(A1, story).told()
    assert judged[0] == "motor_stalled"


def test_an_rplidar_that_is_another_or_out_of_order_is_told() -> None:
    """An A2 at an A1's place is read all the same, and told; an error that a reset does not mend is told too."""
    device = FakeRplidar(noisy_box(), model=0x28)

    async def story(rig: Rig) -> None:
        connected(device, rig)
        await turning(device, 2.0)

    rig = run(A1, story)
    assert [condition for condition, *_ in rig.told()] == ["unknown", "wrong_device", "down"]
    assert len(rig.scans) > 10

    class Broken(FakeRplidar):
        """Comes back from a reset as it was."""

        def receive(self, data: bytes) -> None:
            super().receive(data)
            self.health = HealthStatus.ERROR

    broken = Broken(noisy_box())
    broken.health = HealthStatus.ERROR

    async def another(rig: Rig) -> None:
        connected(broken, rig)
        await turning(broken, 4.0)

    (_, judged, *_) = run(A1, another).told()
    assert judged[0] == "device_error"
    assert "error 4660" in judged[2]
