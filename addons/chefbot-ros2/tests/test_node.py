"""The node among real ROS 2 processes, with a daemon on a simulated robot in a process of its own."""

import asyncio
import math
import os
import sys
from asyncio.subprocess import DEVNULL
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from ros import Probe, bridge, probe, stamp_ns

from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.client import CallError, Client
from chefbotd.transport.ports import reserve_port

SOURCE = {"CHEFBOTD_SAFETY__SOURCES__ROS2__PRIORITY": "4", "CHEFBOTD_SAFETY__SOURCES__ROS2__TIMEOUT_S": "0.5"}
TWIST, TRIGGER = "geometry_msgs/msg/Twist", "std_srvs/srv/Trigger"
TRANSITION, STATE = "lifecycle_msgs/srv/ChangeState", "lifecycle_msgs/srv/GetState"
ACTIVATE, DEACTIVATE = 3, 4
AHEAD = {"linear": {"x": 0.2}, "angular": {"z": 0.1}}
PERIOD_S = 0.05
Scenario = Callable[[Client, Probe], Awaitable[None]]


@asynccontextmanager
async def system(
    folder: Path, config: str = "chefbot", *, source: bool = True
) -> AsyncIterator[tuple[Client, Probe]]:
    """A daemon with its simulated robot, the node, and another ROS process."""
    environment = {"CHEFBOTD_MAPS__FOLDER": str(folder), **(SOURCE if source else {})}
    async with (
        simulated_daemon(config, environment) as (where, _),
        Client.connect(where.host, where.port) as robot,
        bridge(where.port),
        probe() as other,
    ):
        await robot.wait_until_armed()
        yield robot, other


def run(folder: Path, scenario: Scenario, config: str = "chefbot", *, source: bool = True) -> None:
    """Run a scenario, in real time."""

    async def all_of_it() -> None:
        async with system(folder, config, source=source) as (robot, other):
            await scenario(robot, other)

    asyncio.run(all_of_it())


@asynccontextmanager
async def repeating(other: Probe, twist: dict[str, object]) -> AsyncIterator[None]:
    """A velocity at 20 Hz, while the block runs."""
    await other.until_listened("/cmd_vel", TWIST)

    async def repeat() -> None:
        while True:
            await other.publish("/cmd_vel", TWIST, twist)
            await asyncio.sleep(PERIOD_S)

    task = asyncio.create_task(repeat())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def until_moving(robot: Client, *, moving: bool) -> None:
    """Until the wheels turn, or stand."""
    async for event in robot.subscribe("odometry"):
        if (abs(event.data.linear_m_s) > 0.1) if moving else (abs(event.data.linear_m_s) < 1e-3):
            return


async def drive_a_little(robot: Client) -> None:
    """For a second; again when a busy computer let the daemon stand still, as its refusal asks for."""
    while True:
        try:
            await robot.drive_for(1.0, 0.2, 0.3)
        except CallError as refused:
            if refused.kind != "too_old":
                raise
        else:
            return


def status_of(message: dict[str, object], part: str) -> dict[str, object]:
    """What the diagnostics say about a part."""
    (status,) = [status for status in message["status"] if status["name"] == f"chefbot: {part}"]  # type: ignore[attr-defined]
    return dict(status)


def test_everything_that_the_robot_measures_arrives(tmp_path: Path) -> None:
    """Each topic with its frame and its values as the daemon has them, stamped with the time of the measurement."""

    async def scenario(robot: Client, other: Probe) -> None:
        topics = {
            "/odom": "nav_msgs/msg/Odometry",
            "/imu": "sensor_msgs/msg/Imu",
            "/joint_states": "sensor_msgs/msg/JointState",
            "/ranges/front": "sensor_msgs/msg/Range",
            "/scan/lidar": "sensor_msgs/msg/LaserScan",
            "/battery": "sensor_msgs/msg/BatteryState",
        }
        for topic, kind in topics.items():
            await other.subscribe(topic, kind, "sensor")
        for topic in ("/tf", "/tf_static"):
            await other.subscribe(
                topic, "tf2_msgs/msg/TFMessage", "latched" if "static" in topic else "reliable"
            )
        await other.subscribe("/robot_description", "std_msgs/msg/String", "latched")
        await drive_a_little(robot)
        first = {topic: await other.until(topic) for topic in topics}
        state = await robot.get_state()
        odom = await other.until("/odom", lambda message: message["twist"]["twist"]["linear"]["x"] == 0.0)
        at, covariance = odom["pose"]["pose"], odom["pose"]["covariance"]
        heading = state.odometry.heading_rad
        assert (at["position"]["x"], at["position"]["y"]) == pytest.approx(
            (state.odometry.x_m, state.odometry.y_m), abs=1e-3
        )
        assert at["orientation"]["z"] == pytest.approx(math.sin(heading / 2), abs=1e-3)
        assert covariance[0] > 0
        assert covariance[7] > 0
        assert covariance[35] > 0
        assert covariance[14] == 0
        assert first["/joint_states"]["name"] == ["left_wheel", "right_wheel"]
        assert first["/ranges/front"]["range"] == pytest.approx(
            state.topics["ranges"].data.ranges[0].range_m, abs=0.5
        )
        assert first["/battery"]["voltage"] == pytest.approx(state.battery.voltage_v, abs=0.5)
        assert first["/imu"]["header"]["frame_id"] == "base_footprint"
        scan = first["/scan/lidar"]
        assert scan["header"]["frame_id"] == "lidar_link"
        assert sum(value != "inf" for value in scan["ranges"]) > 100
        frames = {one["child_frame_id"]: one for one in other.received["/tf_static"][-1]["transforms"]}
        assert frames.keys() >= {"base_link", "lidar_link", "ultrasonic_link", "imu_link", "front_link"}
        (moved,) = other.received["/tf"][-1]["transforms"]
        assert (moved["header"]["frame_id"], moved["child_frame_id"]) == ("odom", "base_footprint")
        assert "<robot" in other.received["/robot_description"][0]["data"]
        for topic, delays in other.delays_ns.items():
            assert min(delays) > -1_000_000, f"{topic} is stamped later than it arrives"

    run(tmp_path, scenario, "chefbot_lidar")


def test_velocities_drive_and_a_publisher_that_dies_leaves_the_robot_standing(tmp_path: Path) -> None:
    """As the source ros2; killed, it cannot say anything, so the dead-man brakes."""

    async def scenario(robot: Client, other: Probe) -> None:
        async with repeating(other, AHEAD):
            await until_moving(robot, moving=True)
            assert (await robot.get_state()).safety.source == "ros2"
            await other.kill()
        await until_moving(robot, moving=False)
        state = await robot.get_state()
        assert (state.safety.source, state.safety.mode) == (None, "armed")

    run(tmp_path, scenario)


def test_the_emergency_stop_is_a_service_and_so_is_what_ends_it(tmp_path: Path) -> None:
    """While it is pressed, velocities move nothing."""

    async def scenario(robot: Client, other: Probe) -> None:
        await other.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        async with repeating(other, AHEAD):
            await until_moving(robot, moving=True)
            assert (await other.call("/estop", TRIGGER))["success"] is True
            assert (await robot.get_state()).safety.mode == "estopped"
            await until_moving(robot, moving=False)
            refused = await other.until(
                "/diagnostics", lambda message: status_of(message, "bridge")["level"] != [0]
            )
            assert "cmd_vel" in str(status_of(refused, "bridge")["message"])
        assert (await other.call("/arm", TRIGGER))["success"] is True
        assert (await robot.get_state()).safety.mode == "armed"

    run(tmp_path, scenario)


def test_a_lifecycle_manager_activates_and_deactivates_it(tmp_path: Path) -> None:
    """Inactive it is no agent of the daemon, moves nothing and says so; active again, it drives."""

    async def agents(robot: Client) -> list[str]:
        return [agent.name for agent in (await robot.get_state()).agents.agents]

    async def scenario(robot: Client, other: Probe) -> None:
        async with repeating(other, AHEAD):
            await until_moving(robot, moving=True)
            assert await agents(robot) == ["ros2"]
            answer = await other.call("/chefbot/change_state", TRANSITION, {"transition": {"id": DEACTIVATE}})
            assert answer["success"] is True
            await until_moving(robot, moving=False)
            assert await agents(robot) == []
            assert (await other.call("/chefbot/get_state", STATE))["current_state"]["label"] == "inactive"
            stopped = await other.call("/estop", TRIGGER)
            assert (stopped["success"], stopped["message"]) == (False, "the node is not active")
            await other.call("/chefbot/change_state", TRANSITION, {"transition": {"id": ACTIVATE}})
            await until_moving(robot, moving=True)

    run(tmp_path, scenario)


def test_a_source_that_the_robot_does_not_have_is_said(tmp_path: Path) -> None:
    """In the diagnostics, with its name."""

    async def scenario(robot: Client, other: Probe) -> None:
        await other.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        async with repeating(other, AHEAD):
            said = await other.until(
                "/diagnostics", lambda message: "ros2" in status_of(message, "bridge")["message"]
            )
        assert status_of(said, "bridge")["level"] == [1]

    run(tmp_path, scenario, source=False)


def test_it_finds_a_daemon_again_that_was_restarted(tmp_path: Path) -> None:
    """Meanwhile the diagnostics say that there is none; stamps are those of the new daemon."""

    async def scenario() -> None:
        port = reserve_port()
        async with probe() as other, bridge(port):
            await other.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
            await other.subscribe("/odom", "nav_msgs/msg/Odometry", "sensor")
            await other.until("/diagnostics", cannot_connect)
            async with daemon_at(port, tmp_path):
                first = await other.until("/odom")
            again = await other.until("/diagnostics", is_lost)
            async with daemon_at(port, tmp_path):
                second = await other.until("/odom")
            assert stamp_ns(second) > stamp_ns(again) > stamp_ns(first)

    asyncio.run(scenario())


def cannot_connect(message: dict[str, object]) -> bool:
    """Whether the bridge says that nobody listens; before its first attempt it says less."""
    return "cannot connect" in str(status_of(message, "bridge")["message"])


def is_lost(message: dict[str, object]) -> bool:
    """Whether the bridge says that it has no daemon."""
    return status_of(message, "bridge")["level"] == [2]


@asynccontextmanager
async def daemon_at(port: int, folder: Path) -> AsyncIterator[None]:
    """A daemon with its simulated robot, which may not listen yet."""
    words = ("run", "--sim", "--listen", f"127.0.0.1:{port}", "--config", "chefbot")
    environment = {**os.environ, "CHEFBOTD_MAPS__FOLDER": str(folder)}
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "chefbotd.cli.programs.chefbotd", *words, stderr=DEVNULL, env=environment
    )
    try:
        yield
    finally:
        process.terminate()
        await process.wait()
