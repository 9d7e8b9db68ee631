"""The figures of the README: fifty robots' agents in one process, and the time from an order to the robot's drive.

    python addons/chefbot-vda5050/benchmarks/figures.py

Broker: mosquitto on the loopback interface, a process of its own. The robots are those of the tests: they are driven by
no daemon, so what is measured is what this add-on costs.
"""

import asyncio
import contextlib
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import click
from chefbot_vda5050.broker import BrokerParameters
from chefbot_vda5050.messages import NodePosition
from chefbot_vda5050.topics import RobotName
from vda5050_fakes import FakeRobot
from vda5050_mosquitto import mosquitto
from vda5050_online import Master, master, robot_online
from vda5050_orders import line

ROBOTS, SECONDS, ORDERS, POSE_HZ = 50, 20.0, 200, 10.0


async def wander(robot: FakeRobot) -> None:
    """A pose ten times a second, as the daemon tells it, and another driving state every two seconds."""
    tick = 0
    while True:
        await asyncio.sleep(1 / POSE_HZ)
        tick += 1
        robot.set(x_m=tick / 100, linear_m_s=0.0 if tick // 20 % 2 else 0.3)


async def core_share(robots: int, seconds: float, *, driving: bool) -> float:
    """Which share of a core the agents of so many robots take, with one visualization a second of each."""
    with tempfile.TemporaryDirectory() as folder:
        async with mosquitto(Path(folder)) as broker, contextlib.AsyncExitStack() as stack:
            parameters = BrokerParameters("127.0.0.1", broker.port)
            moves = []
            for number in range(robots):
                robot = FakeRobot()
                name = RobotName("chefbot", f"r{number}")
                await stack.enter_async_context(robot_online(parameters, robot, name))
                if driving:
                    moves.append(asyncio.create_task(wander(robot)))
            await asyncio.sleep(3.0)
            before_s, began_s = time.process_time(), time.monotonic()
            await asyncio.sleep(seconds)
            share = (time.process_time() - before_s) / (time.monotonic() - began_s)
            for task in moves:
                task.cancel()
    return share


class TimedRobot(FakeRobot):
    """Notes when it was told to drive, and is there at once."""

    told: Callable[[], None] = staticmethod(lambda: None)

    async def drive_to(self, position: NodePosition, max_speed_m_s: float | None = None) -> None:
        """Jump."""
        self.told()
        self.set(x_m=position.x, y_m=position.y)


async def order_to_drive_ms(orders: int) -> list[float]:
    """From the master's publish to the robot's drive, of each order."""
    with tempfile.TemporaryDirectory() as folder:
        async with mosquitto(Path(folder)) as broker, master(broker.port) as now:
            robot = TimedRobot()
            async with robot_online(BrokerParameters("127.0.0.1", broker.port), robot):
                await now.until_state(lambda state: True)
                return [await _one(now, robot, number) for number in range(orders)]


async def _one(now: Master, robot: TimedRobot, number: int) -> float:
    told = asyncio.get_running_loop().create_future()
    robot.told = lambda: told.done() or told.set_result(time.perf_counter())  # type: ignore[method-assign, func-returns-value]
    order = line(number, number + 1, order_id=f"order {number}")
    began_s = time.perf_counter()
    await now.order(order)
    at_s: float = await told
    await now.until_state(lambda state: state.order_id == order.order_id and not state.node_states)
    return (at_s - began_s) * 1000


def main() -> None:
    """Print the figures."""
    idle = asyncio.run(core_share(ROBOTS, SECONDS, driving=False))
    driving = asyncio.run(core_share(ROBOTS, SECONDS, driving=True))
    click.echo(f"{ROBOTS} agents in one process: {idle:.3f} core standing, {driving:.3f} core driving")
    times = sorted(asyncio.run(order_to_drive_ms(ORDERS)))
    click.echo(
        f"order to drive, {ORDERS} orders: median {statistics.median(times):.1f} ms, "
        f"95 % within {times[int(0.95 * len(times))]:.1f} ms, slowest {times[-1]:.1f} ms"
    )


if __name__ == "__main__":
    main()
