"""What a run is measured with: the true motion of the simulated robot, and the frames on its wire."""

import asyncio

from chefbotd.core.geometry import Twist2D
from chefbotd.testing.daemon import SimulatedRobot

SAMPLE_S = 0.002
MOVING_M_S, MOVING_RAD_S = 0.005, 0.02


def is_moving(robot: SimulatedRobot) -> bool:
    """Whether it really moves."""
    return _is_motion(robot.board.truth(0.0).twist)


def _is_motion(twist: Twist2D) -> bool:
    return abs(twist.linear_m_s) > MOVING_M_S or abs(twist.angular_rad_s) > MOVING_RAD_S


class Stopwatch:
    """From when it is made: when the board last had a duty, when the robot last moved, and how fast it was at most."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot, self._start_s = robot, asyncio.get_running_loop().time()
        self.zero_s = self.rest_s = self.fastest_m_s = 0.0
        self._task = asyncio.create_task(self._run())

    async def stop(self) -> None:
        """Look no more."""
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    async def _run(self) -> None:
        while True:
            await asyncio.sleep(SAMPLE_S)
            elapsed_s = asyncio.get_running_loop().time() - self._start_s
            if any(self._robot.board.duty):
                self.zero_s = elapsed_s
            twist = self._robot.board.truth(0.0).twist
            if _is_motion(twist):
                self.rest_s = elapsed_s
            self.fastest_m_s = max(self.fastest_m_s, abs(twist.linear_m_s))


class FrameCount:
    """Lines that the board sends from now on and the daemon never took, whoever lost them."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._session, self._feed = robot.daemon.session, robot.device.feed
        self._sent, self._taken = 0, self._frames()
        robot.device.feed = self._count

    @property
    def lost(self) -> int:
        """So many."""
        return max(self._sent - (self._frames() - self._taken), 0)

    def _count(self, data: bytes) -> None:
        self._sent += sum(1 for line in data.splitlines() if line)
        self._feed(data)

    def _frames(self) -> int:
        return sum(self._session.frames.values())


class StepCount:
    """Encoder frames that the session took from now on, and that neither led to a control step nor were refused."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot = robot
        self._before = self._behind()

    @property
    def missed(self) -> int:
        """So many; the last of them may be on its way."""
        return max(self._behind() - self._before - 1, 0)

    def _behind(self) -> int:
        driving = self._robot.daemon.driving
        return (
            self._robot.daemon.session.frames.get("EncoderCounts", 0)
            - driving.memory.steps
            - driving.reader.memory.refused
        )


def task_count() -> int:
    """How many tasks there are, but for the one that builds the schemas of `describe` in a thread and then ends.

    A thread takes real time, so on the virtual clock nobody knows when that is.
    """
    coroutines = [task.get_coro() for task in asyncio.all_tasks()]
    return sum(not getattr(each, "__name__", "").endswith("prepare_description") for each in coroutines)
