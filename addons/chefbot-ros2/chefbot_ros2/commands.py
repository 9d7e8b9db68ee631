"""What ROS asks of the robot, as methods of the daemon's socket: velocities, poses, goals, and stops."""

import asyncio
import math
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from typing import Any, Final

import structlog

from chefbot_ros2.messages import MAP
from chefbotd.client import CallError, CallTimeout, Client
from chefbotd.client.caller import ignore_progress
from chefbotd.core.geometry import Pose2D, Twist2D

log = structlog.get_logger("ros2")

OLDEST_VELOCITY_S: Final = 0.2
"""An older one may be of a publisher that has died since; one at 10 Hz has a new one by then."""

MOST_RUNNING: Final = 64
"""Requests of a client that wait for the daemon."""


class NotConnected(Exception):
    """There is no connection to the daemon at present; the message says why."""


class Commands:
    """Everything is asked on one connection, whose roles, leases and dead-man are the daemon's affair.

    Velocities count as those of the source ``source``. ``refused`` is the sentence about the last thing that was
    refused, empty once something was not; ``on_refused`` is called with each. ``stop_number`` is that of the last
    stop or fault of the robot when the present request came: the daemon refuses a motion after any later one.
    """

    def __init__(
        self,
        source: str,
        on_refused: Callable[[str], None] = lambda why: None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._source, self._on_refused, self._now_s = source, on_refused, now_s
        self._robot: Client | None = None
        self._tasks: asyncio.TaskGroup | None = None
        self._running: set[asyncio.Task[None]] = set()
        self._velocity: tuple[Twist2D, float, int | None] | None = None
        self.stop_number: int | None = None
        self._has_velocity = asyncio.Event()
        self.refused = ""

    @asynccontextmanager
    async def serving(self, robot: Client) -> AsyncIterator[None]:
        """Carry out what is asked, on this connection, while the block runs."""
        self._velocity = None
        async with asyncio.TaskGroup() as tasks:
            self._robot, self._tasks = robot, tasks
            self._start(self._drive(robot))
            try:
                yield
            finally:
                self._robot = self._tasks = None
                for task in self._running:
                    task.cancel()

    async def serve(self, robot: Client) -> None:
        """Carry out what is asked, on this connection, until cancelled."""
        async with self.serving(robot):
            await asyncio.Event().wait()

    def _start(self, work: Coroutine[Any, Any, None]) -> "asyncio.Task[None]":
        if self._tasks is None:
            raise NotConnected("there is no connection to the daemon")
        return self._keep(self._tasks.create_task(work))

    def begin(self, work: Coroutine[Any, Any, None]) -> "asyncio.Task[None]":
        """Have this done while there is a connection; without one it is done at once, and says so."""
        return self._keep(asyncio.ensure_future(work)) if self._tasks is None else self._start(work)

    def _keep(self, task: "asyncio.Task[None]") -> "asyncio.Task[None]":
        self._running.add(task)
        task.add_done_callback(self._running.discard)
        return task

    def drive(self, linear_m_s: float, angular_rad_s: float, since_s: float | None = None) -> None:
        """Drive so, once: the daemon's dead-man ends it. Without a connection it is forgotten.

        ``since_s`` is when it came, if that was not now. A motion that had to wait too long is not carried out.
        """
        if not (math.isfinite(linear_m_s) and math.isfinite(angular_rad_s)):
            self._refuse(f"cmd_vel: expected finite numbers, got {linear_m_s} and {angular_rad_s}")
        elif self._robot is not None:
            came_s = self._now_s() if since_s is None else since_s
            self._velocity = Twist2D(linear_m_s, angular_rad_s), came_s, self.stop_number
            self._has_velocity.set()

    async def _drive(self, robot: Client) -> None:
        """The newest velocity, one request at a time."""
        while True:
            await self._has_velocity.wait()
            self._has_velocity.clear()
            newest, self._velocity = self._velocity, None
            if newest is None:
                continue
            velocity, came_s, stop_number = newest
            if velocity != Twist2D() and self._now_s() - came_s > OLDEST_VELOCITY_S:
                self._refuse(f"cmd_vel: a velocity waited for more than {OLDEST_VELOCITY_S:g} s")
                continue
            await self._carry_out(
                "cmd_vel",
                robot.call(
                    "drive",
                    linear_m_s=velocity.linear_m_s,
                    angular_rad_s=velocity.angular_rad_s,
                    source=self._source,
                    **({} if velocity == Twist2D() else known(stop_number)),
                ),
            )

    def set_pose(self, frame: str, pose: Pose2D) -> None:
        """RViz says about where the robot is."""
        self._ask(
            "initialpose", frame, pose, lambda robot: robot.set_pose(pose.x_m, pose.y_m, pose.heading_rad)
        )

    def navigate(self, frame: str, pose: Pose2D, stop_number: int | None = None) -> None:
        """RViz says where it shall go; a goal before this one is cancelled.

        ``stop_number`` is that of the moment in which the goal came, if that was not now.
        """
        params = {"x_m": pose.x_m, "y_m": pose.y_m, "heading_rad": pose.heading_rad}
        params |= known(self.stop_number if stop_number is None else stop_number)
        self._ask(
            "goal_pose",
            frame,
            pose,
            lambda robot: robot.call("navigate_to", on_progress=ignore_progress, **params),
        )

    def _ask(
        self, topic: str, frame: str, pose: Pose2D, call: Callable[[Client], Coroutine[Any, Any, Any]]
    ) -> None:
        if self._robot is None or self._tasks is None:
            log.warning("not done, for there is no connection to the daemon", topic=topic)
        elif not all(math.isfinite(value) for value in (pose.x_m, pose.y_m, pose.heading_rad)):
            self._refuse(f"{topic}: expected finite numbers, got {pose.x_m}, {pose.y_m}, {pose.heading_rad}")
        elif frame != MAP:
            self._refuse(f"{topic}: expected the frame {MAP}, got {frame!a}")
        elif len(self._running) >= MOST_RUNNING:
            self._refuse(f"{topic}: {MOST_RUNNING} requests wait for the daemon already")
        else:
            self._start(self._carry_out(topic, call(self._robot)))

    async def _carry_out(self, topic: str, call: Coroutine[Any, Any, Any]) -> None:
        try:
            await call
            self.refused = ""
        except (CallError, CallTimeout) as refused:
            self._refuse(f"{topic}: {refused}")

    def _refuse(self, why: str) -> None:
        if why != self.refused:
            log.warning("not done", why=why)
        self.refused = why
        self._on_refused(why)

    async def estop(self) -> None:
        """Stop the motors at once; raises ``NotConnected`` or ``ChefbotError``."""
        await self._connected().estop("by ROS")

    async def arm(self) -> None:
        """Allow motion again; raises as ``estop`` does."""
        await self._connected().call("arm")

    async def take_control(self) -> None:
        """Have the source of velocities for this connection alone; raises as ``estop`` does."""
        await self._connected().take_control(self._source)

    async def release_control(self) -> None:
        """Give it back; raises as ``estop`` does."""
        await self._connected().release_control()

    def _connected(self) -> Client:
        if self._robot is None:
            raise NotConnected("there is no connection to the daemon")
        return self._robot


def known(stop_number: int | None) -> dict[str, Any]:
    """The parameter ``if_stop_number``, where a number is known."""
    return {} if stop_number is None else {"if_stop_number": stop_number}


SERVICES: dict[str, Callable[[Commands], Coroutine[Any, Any, None]]] = {
    "estop": Commands.estop,
    "arm": Commands.arm,
    "take_control": Commands.take_control,
    "release_control": Commands.release_control,
}
"""Each a std_srvs/Trigger."""
