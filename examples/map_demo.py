"""``chefbotctl map demo``: a simulated ChefBot with a lidar maps the flat, from the first scan to the files.

It is driven through rooms that are known from the flat's plan, by where SLAM says that it is. At the end the map is held
against the true walls.
"""

import asyncio
import time
from pathlib import Path
from typing import Any, Final

from chefbotd.cli.common.context import CommandContext, beside
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive.control import send_drive
from chefbotd.cli.drive.simulated_daemon import simulated_daemon, until_ready
from chefbotd.client import Client
from chefbotd.client.models import MapSaved
from chefbotd.components.maps.cli.live_view import MappingScene, Show, listen
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.record import Record
from examples.robot_time import RobotTime, follow
from examples.route import Point, is_reached, length_m, seen_from, velocity_to

ROOMS: Final[tuple[Point, ...]] = (
    (2.35, 2.9), (2.35, 4.0), (2.72, 4.25), (2.75, 5.6), (2.72, 4.1), (4.9, 4.05), (4.93, 5.1), (5.1, 6.1),
    (5.6, 6.93), (6.7, 6.93), (7.2, 6.25), (8.35, 6.3), (8.45, 5.3), (8.45, 3.9), (6.65, 3.9), (6.62, 2.9),
    (6.55, 1.5), (5.45, 1.45), (4.5, 1.45), (4.45, 2.57), (3.0, 2.57), (2.4, 2.75), (2.35, 3.95), (2.4, 2.9),
)  # fmt: skip
"""Through hall, bedroom, study, child's room, hall and kitchen back into the living room: two loops in the plan."""

STUCK_S: Final = 15.0
COMMAND_S: Final = 0.1


class Processes(Record, frozen=True):
    """What the daemon (with the simulator in it) and its worker used while the robot drove; None: cannot be told."""

    daemon_cpu: float | None
    daemon_mb: float | None
    worker_cpu: float | None
    worker_mb: float | None


class DemoResult(Record, frozen=True):
    """What came of it; ``seconds`` are by the robot's clock, ``late`` is what is to be said of a busy computer."""

    saved: MapSaved
    grid: OccupancyGrid
    pose: Pose2D
    seconds: float
    control_steps: int
    missed_steps: int
    worker_restarts: int
    processes: Processes
    late: str = ""


class Demo:
    """One run; ``show`` is called with each change."""

    def __init__(self, folder: Path, name: str, start: Pose2D, show: Show) -> None:
        self._folder, self._name, self._show = folder, name, show
        self._start, self._time = start, RobotTime()
        self._points = seen_from(start, ROOMS)
        self._scene = MappingScene(doing="starting the simulated robot")
        self._worker_pid: int | None = None

    async def run(self) -> DemoResult:
        """Start the robot, map, and save.

        Raises:
            ProgramError: it was not done, and why.
        """
        self._show(self._scene)
        environment = {"CHEFBOTD_MAPS__FOLDER": str(self._folder.absolute())}
        async with simulated_daemon("chefbot_lidar", environment, own_clock=True) as (where, daemon_pid):
            return await CommandContext(where).with_client(lambda robot: self._with_robot(robot, daemon_pid))

    async def _with_robot(self, robot: Client, daemon_pid: int) -> DemoResult:
        self._worker_pid = await until_ready(robot, self._say)
        await robot.discard_mapping()
        await robot.start_mapping()
        async with beside(follow(robot, self._time), listen(robot, self._scene, self._show)):
            await self._time.until_first()
            before, used = await robot.get_stats(), Usage(daemon_pid, self._worker_pid)
            began_s = self._time.now_s
            await self._drive(robot)
            driven_s, late = self._time.now_s - began_s, self._time.late_text()
            processes = used.since()
            self._scene.doing = "matching all scans with each other"
            saved = await robot.finish_mapping(self._name, on_progress=self._report)
        after, image = await robot.get_stats(), (await robot.get_map(self._name)).grid()
        return DemoResult(
            saved=saved,
            grid=image,
            pose=self._scene.tracker.pose or Pose2D(),
            seconds=driven_s,
            control_steps=_count(after, "control_steps") - _count(before, "control_steps"),
            missed_steps=missed_steps(before, after),
            worker_restarts=_count(after, "worker_restarts") - _count(before, "worker_restarts"),
            processes=processes,
            late=late,
        )

    async def _drive(self, robot: Client) -> None:
        """Through all points; it fails where the robot comes no nearer to the end for some time."""
        scene, total = self._scene, len(self._points)
        nearest_m, nearer_s = float("inf"), self._time.now_s
        try:
            while self._points:
                scene.doing = f"driving, point {total - len(self._points) + 1} of {total}"
                pose = scene.tracker.pose
                if pose is not None:
                    if is_reached(pose, self._points[0]):
                        self._points = self._points[1:]
                        continue
                    after = self._points[1] if len(self._points) > 1 else None
                    twist = velocity_to(pose, self._points[0], after)
                    await send_drive(robot, twist)
                    left_m = length_m(pose, self._points)
                    if left_m < nearest_m - 0.05:
                        nearest_m, nearer_s = left_m, self._time.now_s
                if self._time.now_s - nearer_s > STUCK_S:
                    raise ProgramError(Exit.NOT_DONE, await self._why_stuck(robot))
                await asyncio.sleep(COMMAND_S)
        finally:
            await robot.stop()

    async def _why_stuck(self, robot: Client) -> str:
        safety = (await robot.get_state()).safety
        held_by = safety.limited_by or (safety.reason if safety.mode != "armed" else "nobody knows what")
        return f"{self._scene.doing}: no progress for {STUCK_S:g} s, blocked by {held_by}"

    def _say(self, doing: str) -> None:
        self._scene.doing = doing
        self._show(self._scene)

    def _report(self, done: float, total: float, text: str) -> None:
        self._scene.doing = f"{text} ({100 * done / total:.0f} %)"
        self._show(self._scene)


class Usage:
    """Processor time and memory of two processes, from when this was made."""

    def __init__(self, daemon: int, worker: int | None) -> None:
        self._pids = (daemon, worker)
        self._began_s = time.monotonic()
        self._before = [_cpu_s(pid) for pid in self._pids]

    def since(self) -> Processes:
        """What they have used since."""
        passed_s = time.monotonic() - self._began_s
        shares = [
            None if then is None or now is None else (now - then) / passed_s
            for then, now in zip(self._before, map(_cpu_s, self._pids), strict=True)
        ]
        memory = [_memory_mb(pid) for pid in self._pids]
        return Processes(shares[0], memory[0], shares[1], memory[1])


def _cpu_s(pid: int | None) -> float | None:
    from chefbotd.components.worker.spawn import cpu_s_of

    return None if pid is None else cpu_s_of(pid)


def _memory_mb(pid: int | None) -> float | None:
    from chefbotd.components.worker.spawn import rss_mb_of

    return None if pid is None else rss_mb_of(pid)


def _count(stats: Any, name: str) -> int:
    return int(getattr(stats, name))


def missed_steps(before: Any, after: Any) -> int:
    """Readings of the encoders that were not refused and had no control step; one may be on its way."""
    return max(0, _without_step(after) - _without_step(before) - 1)


def _without_step(stats: Any) -> int:
    readings = stats.frames.get("EncoderCounts", 0)
    return int(readings - stats.encoder_readings_refused - stats.control_steps)
