"""The simulated RPLIDAR: its bytes, read by the decoder that reads the real one's, and the daemon in front of it."""

import asyncio
import math
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.simulation import scene
from chefbotd.components.simulation.lidar import LidarFault
from chefbotd.components.simulation.lidar_devices import SimulatedRplidar
from chefbotd.components.simulation.parameters.simulation import LidarFlaws
from chefbotd.components.simulation.spinning import LidarMount, LidarWire, Sight
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.geometry import Pose2D
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from firmware_protocol.lidar.rplidar import (
    FULL_TURN_Q6,
    Answer,
    Capsule,
    DeviceHealth,
    DeviceInfo,
    HealthStatus,
    RequestCode,
    RplidarDecoder,
    ScanNode,
    express_request,
    motor_request,
    request,
)
from tests.budget import sample

Told = TypeVar("Told", ScanNode, Capsule)
PERFECT: dict[str, Any] = {"noise_m": 0, "lost_share": 0, "rate_error_share": 0, "rate_wobble_share": 0}
ROOM = scene.of_walls(np.array([[2, -3, 2, 3], [2, 3, -4, 3], [-4, 3, -4, -3], [-4, -3, 2, -3]], np.float64))
STANDING = np.array([[0.0, 0.0, 0.0, 0.0]])
NOBODY = np.zeros((0, 3))


def wall_m(clockwise_rad: float) -> float:
    """From the lidar, 0.3 rad turned at (0.1, -0.05), to the wall."""
    bearing = 0.3 - clockwise_rad
    cos, sin = math.cos(bearing), math.sin(bearing)
    ahead_m = ((2 - 0.1) if cos > 0 else (4 + 0.1)) / max(abs(cos), 1e-9)
    aside_m = ((3 + 0.05) if sin > 0 else (3 - 0.05)) / max(abs(sin), 1e-9)
    return min(ahead_m, aside_m)


class Conversation:
    """A lidar in a room of 6 by 6 m, and what it has answered and sent."""

    def __init__(self, wire: LidarWire = LidarWire.RPLIDAR_A1, **flaws: Any) -> None:
        parameters = LidarFlaws.model_validate({**PERFECT, **flaws})
        mount = LidarMount(base_from_lidar=Pose2D(0.1, -0.05, 0.3), wire=wire)
        self.lidar = SimulatedRplidar(parameters, mount, Sight(ROOM, 0.2, parameters), 3)
        self.decoder, self.now_s = RplidarDecoder(), 0.0

    def say(self, data: bytes, chunk: int = 100) -> list[Answer]:
        """Bytes in pieces; the answers."""
        pieces = [data[at : at + chunk] for at in range(0, len(data), chunk)]
        return self.decoder.feed_bytes(b"".join(self.lidar.receive(piece) for piece in pieces))

    def wait(self, seconds: float) -> list[ScanNode]:
        """The nodes of so long a time."""
        return self.hear(seconds, ScanNode)

    def hear(self, seconds: float, kind: type[Told]) -> list[Told]:
        """What is sent of this kind in so long a time."""
        nodes: list[Answer] = []
        for _ in range(round(seconds / 0.01)):
            self.now_s += 0.01
            nodes += self.decoder.feed_bytes(b"".join(self.lidar.send_packets(self.now_s, STANDING, NOBODY)))
        return [node for node in nodes if isinstance(node, kind)]


@pytest.mark.parametrize("chunk", [1, 2, 100])
@pytest.mark.parametrize(("wire", "model"), [(LidarWire.RPLIDAR_A1, 0x18), (LidarWire.RPLIDAR_A2, 0x28)])
def test_it_says_what_it_is_and_how_it_is(wire: LidarWire, model: int, chunk: int) -> None:
    """In whatever pieces it is asked, with other bytes before; an old firmware offers no express scan."""
    device = Conversation(wire, express="absent")
    (info,) = device.say(b"\x00\x17" + request(RequestCode.GET_INFO), chunk)
    assert isinstance(info, DeviceInfo)
    assert (info.model, info.firmware) == (model, (1, 15))
    assert device.say(request(RequestCode.GET_HEALTH), chunk) == [DeviceHealth(HealthStatus.GOOD, 0)]
    assert device.say(express_request(), chunk) == []
    assert device.wait(0.2) == []


def test_angles_grow_clockwise_and_distances_are_those_of_the_walls() -> None:
    """2000 nodes a second, 5.5 turns; each distance is the one from the lidar, 0.3 rad turned, to its wall."""
    device = Conversation()
    device.say(request(RequestCode.SCAN))
    nodes = device.wait(2.0)
    assert len(nodes) == pytest.approx(4000, abs=3)
    assert sum(node.starts_turn for node in nodes) == 11
    assert not device.decoder.refused
    turns = [index for index, node in enumerate(nodes) if node.starts_turn]
    assert {b - a for a, b in pairwise(turns)} <= {363, 364}
    for node in nodes[::37]:
        assert node.distance_q2 / 4000 == pytest.approx(
            wall_m(node.angle_q6 * math.tau / FULL_TURN_Q6), abs=0.003
        )


@pytest.mark.parametrize(("wire", "turns_per_s"), [(LidarWire.RPLIDAR_A1, 5.5), (LidarWire.RPLIDAR_A2, 10.0)])
def test_an_express_scan_has_twice_as_many_points(wire: LidarWire, turns_per_s: float) -> None:
    """125 capsules of 32 points a second, the first of them marked; each point lies on its wall."""
    device = Conversation(wire)
    device.say(motor_request(660) + express_request())
    capsules = device.hear(2.0, Capsule)
    assert len(capsules) == pytest.approx(250, abs=1)
    assert [capsule.is_first for capsule in capsules] == [True] + [False] * (len(capsules) - 1)
    assert not device.decoder.refused
    turned = sum((b.start_q6 - a.start_q6) % FULL_TURN_Q6 for a, b in pairwise(capsules)) / FULL_TURN_Q6
    assert turned / ((len(capsules) - 1) * 32 / 4000) == pytest.approx(turns_per_s, rel=0.002)
    for one, after in [*pairwise(capsules)][::11]:
        for angle_q6, distance_mm in zip(one.angles_q6(after.start_q6), one.distance_mm, strict=True):
            assert distance_mm / 1000 == pytest.approx(wall_m(angle_q6 * math.tau / FULL_TURN_Q6), abs=0.01)


def test_from_one_scan_to_the_other_it_goes_on_in_time() -> None:
    """Express for a second, then standard, then express: each at its own rate, with no gap and nothing twice."""
    device = Conversation()
    for asked, kind, points in (
        (express_request(), Capsule, 125),
        (request(RequestCode.SCAN), ScanNode, 2000),
    ) * 2:
        device.say(request(RequestCode.STOP))
        device.decoder.reset()
        device.say(asked)
        assert len(device.hear(1.0, kind)) == pytest.approx(points, abs=points / 50)
        assert device.lidar.measured_s == pytest.approx(device.now_s, abs=0.02)


@pytest.mark.parametrize("promised", ["promised", "absent"])
def test_without_an_express_scan_nothing_comes_of_the_request(promised: str) -> None:
    """Neither an answer nor a scan."""
    device = Conversation(express=promised)
    assert device.say(express_request()) == []
    assert device.wait(0.3) == []


def test_it_sends_only_what_it_is_asked_for() -> None:
    """Nothing before a scan is asked for, nothing after a stop or a reset; a held motor gives no points."""
    device = Conversation()
    assert device.wait(0.3) == []
    device.say(request(RequestCode.SCAN))
    assert len(device.wait(0.3)) > 590
    device.lidar.stall(device.now_s)
    assert device.wait(0.3) == []
    device.lidar.release(device.now_s)
    assert len(device.wait(0.3)) > 590
    for ending in (RequestCode.STOP, RequestCode.RESET):
        device.say(request(ending))
        device.decoder.reset()
        assert device.wait(0.3) == []
        device.say(request(RequestCode.SCAN))
        assert len(device.wait(0.3)) > 590


def test_out_of_order_it_scans_after_a_reset_only() -> None:
    """As the maker's manual says of its health."""
    device = Conversation()
    device.lidar.health = HealthStatus.ERROR
    assert device.say(request(RequestCode.GET_HEALTH)) == [DeviceHealth(HealthStatus.ERROR, 0)]
    device.say(request(RequestCode.SCAN))
    assert device.wait(0.1) == []
    assert device.lidar.receive(request(RequestCode.RESET)).startswith(b"RP LIDAR")
    device.say(request(RequestCode.SCAN))
    assert len(device.wait(0.3)) > 590


def test_an_a2_turns_when_it_is_told_to() -> None:
    """By its own motor request, 10 turns a second; a damaged one does nothing."""
    device = Conversation(LidarWire.RPLIDAR_A2)
    device.say(request(RequestCode.SCAN))
    device.say(motor_request(660)[:-1] + b"\x00")
    assert device.wait(0.2) == []
    device.say(motor_request(660))
    assert sum(node.starts_turn for node in device.wait(1.0)) == 10
    device.say(motor_request(0))
    assert device.wait(0.2) == []


def test_near_and_far_there_is_no_reading() -> None:
    """The wall at 3.05 m is beyond 3 m of range: distance 0, quality 0."""
    device = Conversation(max_range_m=2.0)
    device.say(request(RequestCode.SCAN))
    nodes = device.wait(0.4)
    none = [node for node in nodes if node.distance_q2 == 0]
    assert 0.4 < len(none) / len(nodes) < 0.95
    assert {node.quality for node in none} == {0}


TURNS_PER_S = {"rplidar_a1": 5.5, "rplidar_a2": 10.0}


@pytest.mark.parametrize(
    ("offered", "express", "points_per_s"),
    sample(
        [("offered", True, 4000), ("offered", False, 2000), ("promised", True, 2000), ("absent", True, 2000)]
    ),
)
def test_the_daemon_takes_the_express_scan_where_there_is_one(
    offered: str, express: bool, points_per_s: int
) -> None:
    """Healthy with either scan; what was promised and never comes is given up for the standard scan after 4 s."""
    lidar = {"name": "scan", "model": "rplidar_a1", "device": "/dev/rp", "express": express}
    overrides = {"lidar": [lidar], "sim.world.map_path": "flat", "sim.lidar.express": offered}
    beams: list[int] = []

    async def play() -> None:
        async with simulated_robot(load(packaged("chefbot"), overrides=overrides)) as robot:
            robot.daemon.bus.add_handler(lambda event: beams.append(len(event.scan.range_m)), ScanMeasured)
            await asyncio.sleep(9.0 if offered == "promised" else 4.0)
            told = (await robot.client.get_state()).topics["lidars"].data.lidars[0]
            assert told.condition == "healthy"

    run_virtual(play())
    assert beams[-1] == pytest.approx(points_per_s / 5.5, rel=0.02)


@pytest.mark.parametrize("model", sample(["rplidar_a1", "rplidar_a2"]))
@pytest.mark.slow
def test_the_daemon_sees_by_it_stops_by_it_and_gets_over_its_faults(model: str) -> None:
    """Healthy with whole turns; the guard holds the robot off a bag; silent and unplugged it is told, and comes back."""
    lidar = {"name": "scan", "model": model, "device": "/dev/rp", "mount_x_m": 0.04, "mount_yaw_rad": 0.6}
    start = {"sim.world.start_x_m": 2.5, "sim.world.start_y_m": 2.4, "sim.world.start_heading_rad": 1.8}
    ahead = {"x_m": 2.5 + 1.0 * math.cos(1.8), "y_m": 2.4 + 1.0 * math.sin(1.8), "radius_m": 0.1}
    overrides = {"lidar": [lidar], "sim.world.map_path": "flat", "sim.things": [ahead], **start}
    beams: list[int] = []

    async def condition(robot: SimulatedRobot) -> str:
        return str((await robot.client.get_state()).topics["lidars"].data.lidars[0].condition)

    async def play() -> None:
        async with simulated_robot(load(packaged("chefbot"), overrides=overrides)) as robot:
            robot.daemon.bus.add_handler(lambda event: beams.append(len(event.scan.range_m)), ScanMeasured)
            await asyncio.sleep(4.0)
            assert await condition(robot) == "healthy"
            assert beams[-1] == pytest.approx(4000 / TURNS_PER_S[model], abs=3), "it took the express scan"
            for _ in range(120):
                await robot.client.drive(0.2, 0.0)
                await asyncio.sleep(0.05)
                assert not robot.board.truth(0.0).in_contact
            assert abs(robot.board.truth(0.0).twist.linear_m_s) < 0.01, "it stands before the bag"
            robot.lidars["scan"].runner.fault = LidarFault.SILENT
            await asyncio.sleep(3.0)
            assert await condition(robot) == "silent"
            robot.lidars["scan"].runner.fault = None
            await asyncio.sleep(8.0)
            assert await condition(robot) == "healthy"
            robot.lidars["scan"].device.unplug()
            await asyncio.sleep(1.0)
            robot.lidars["scan"].device.plug()
            await asyncio.sleep(8.0)
            assert await condition(robot) == "healthy"

    run_virtual(play())
