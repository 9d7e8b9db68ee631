"""What the node costs: latency of a velocity, age of odometry, and CPU, beside a daemon on a simulated robot.

    PYTHONPATH=addons/chefbot-ros2/tests .venv/bin/python addons/chefbot-ros2/benchmarks/bridge.py [SECONDS]

A velocity's latency is from rclpy's publish in another process to the request on the daemon's socket. Odometry's age is
from the measurement to rclpy's call-back in that process; beside it stands the age for a client of the socket.
"""

import asyncio
import sys
import tempfile
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import numpy as np
import psutil
from chefbot_ros2.session import clock_offset_ns
from ros import Probe, bridge, probe
from test_node import SOURCE, TWIST

from chefbotd.cli.drive.simulated_daemon import simulated_daemon
from chefbotd.client import Client

SETTLES_S, VELOCITIES, PERIOD_S = 3.0, 300, 0.05
TOPICS = {
    "/odom": ("nav_msgs/msg/Odometry", "sensor"),
    "/tf": ("tf2_msgs/msg/TFMessage", "reliable"),
    "/joint_states": ("sensor_msgs/msg/JointState", "reliable"),
    "/imu": ("sensor_msgs/msg/Imu", "sensor"),
    "/scan/lidar": ("sensor_msgs/msg/LaserScan", "sensor"),
    "/diagnostics": ("diagnostic_msgs/msg/DiagnosticArray", "reliable"),
}
TARGETS = {"velocity_ms": 5.0, "odometry_ms": 10.0, "cores": 0.03}


class Proxy:
    """Between the node and the daemon: notes when each ``drive`` comes by."""

    def __init__(self, port: int) -> None:
        self._port = port
        self.drives_ns: asyncio.Queue[int] = asyncio.Queue()

    @asynccontextmanager
    async def listening(self) -> AsyncIterator[int]:
        """Its port."""
        server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        async with server:
            yield server.sockets[0].getsockname()[1]
            server.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        down, up = await asyncio.open_connection("127.0.0.1", self._port)
        await asyncio.gather(self._copy(reader, up), self._copy(down, writer), return_exceptions=True)

    async def _copy(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while data := await reader.read(1 << 16):
            now_ns = time.time_ns()
            for _ in range(data.count(b'"method":"drive"')):
                self.drives_ns.put_nowait(now_ns)
            writer.write(data)
        writer.close()


async def velocities_ms(other: Probe, proxy: Proxy) -> list[float]:
    """How long each velocity takes to the socket; as often as Nav2 sends them."""
    await other.until_listened("/cmd_vel", TWIST)
    took_ms = []
    for number in range(VELOCITIES):
        at_ns = await other.publish_timed("/cmd_vel", TWIST, {"angular": {"z": 0.1 + 0.001 * number}})
        arrived_ns = await asyncio.wait_for(proxy.drives_ns.get(), 5.0)
        took_ms.append((arrived_ns - at_ns) / 1e6)
        await asyncio.sleep(PERIOD_S)
    return took_ms


async def socket_ages_ms(robot: Client, seconds: float) -> list[float]:
    """Odometry's age where a client of the socket reads it."""
    offset_ns, ages_ms = await clock_offset_ns(robot), []
    ends_s = time.monotonic() + seconds
    async for event in robot.subscribe("odometry"):
        ages_ms.append((time.time_ns() - offset_ns) / 1e6 - event.stamp_s * 1e3)
        if time.monotonic() > ends_s:
            break
    return ages_ms


def summary(values: list[float]) -> str:
    """Median and 99th percentile."""
    return f"median {np.median(values):6.2f} ms, p99 {np.percentile(values, 99):6.2f} ms, of {len(values)}"


async def main(seconds: float) -> None:
    """Measure, and print each figure beside what is asked for."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {"CHEFBOTD_MAPS__FOLDER": folder, **SOURCE}
        async with (
            simulated_daemon("chefbot_lidar", environment) as (where, pid),
            Client.connect(where.host, where.port) as robot,
        ):
            proxy = Proxy(where.port)
            async with proxy.listening() as port, bridge(port) as node, probe() as other:
                await robot.wait_until_armed()
                for topic, (kind, qos) in TOPICS.items():
                    await other.subscribe(topic, kind, qos)
                for topic in TOPICS:
                    await other.until(topic)
                await asyncio.sleep(SETTLES_S)
                other.delays_ns.clear()
                process, daemon = psutil.Process(node.pid), psutil.Process(pid)
                before, daemon_before = process.cpu_times(), daemon.cpu_times()
                began_s = time.monotonic()
                ages = await socket_ages_ms(robot, seconds)
                took_s = time.monotonic() - began_s
                after, daemon_after = process.cpu_times(), daemon.cpu_times()
                odometry = [age_ns / 1e6 for age_ns in other.delays_ns["/odom"]]
                cores, daemons = (
                    (b.user + b.system - a.user - a.system) / took_s
                    for a, b in ((before, after), (daemon_before, daemon_after))
                )
                velocity = await velocities_ms(other, proxy)
    print(f"a velocity to the socket: {summary(velocity)} (asked: {TARGETS['velocity_ms']:g} ms)")
    print(f"odometry's age in ROS:    {summary(odometry)} (asked: p99 {TARGETS['odometry_ms']:g} ms)")
    print(f"odometry's age, socket:   {summary(ages)}")
    print(
        f"CPU: node {cores:.3f} core (asked: {TARGETS['cores']:g}), daemon with its simulator {daemons:.3f}"
    )
    print("with 20 odometry, wheels, IMU and 10 scans a second, and a subscriber of each")


if __name__ == "__main__":
    asyncio.run(main(float(sys.argv[1]) if len(sys.argv) > 1 else 30.0))
