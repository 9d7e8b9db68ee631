"""A gymnasium environment: the simulated ChefBot drives to a goal in a room, by what its lidar sees.

The whole daemon runs on the virtual clock: its ramps, its guard against obstacles and its noise are what is learned on.
Needs ``pip install -r examples/learning/requirements.txt``. Each robot logs that it begins; for thousands of them:
``structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.ERROR))``.
"""

import asyncio
import contextlib
import math
from typing import Any, Final

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from chefbotd.client import Subscription
from chefbotd.client.models import ScanData
from chefbotd.clock import VirtualLoop
from chefbotd.core.events import TruthSimulated
from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.settings import load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from examples.scans import nearest_m, points_of

Row = npt.NDArray[np.float32]
STEP_S = 0.2
SECTORS, REACH_M = 24, 4.0
FASTEST_M_S, FASTEST_RAD_S = 0.4, 1.5
AT_GOAL_M, CONTACT_COST, GOAL_REWARD = 0.15, 5.0, 10.0
ROOM: Final = (5.45, 0.9, 6.75, 2.2)
"""The free square of the flat's kitchen, in which it starts and to which it is sent: left, bottom, right, top."""


class ChefBotEnv(gymnasium.Env[Row, Row]):
    """Call ``reset`` first. An action is two speeds as shares of the fastest: ahead and to the left, each from -1 to 1.

    An observation is the nearest obstacle in each of 24 sectors (CCW from straight ahead), the distance and the bearing
    of the goal, and both speeds, each scaled to between -1 and 1. The reward is the metres that the robot came
    nearer to the goal, and 10 for being there; touching something costs 5 and ends the episode.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self) -> None:
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = spaces.Box(-1.0, 1.0, (SECTORS + 4,), np.float32)
        self._loop, self._stack = VirtualLoop(), contextlib.AsyncExitStack()
        self._robot: SimulatedRobot
        self._scans: Subscription[ScanData]
        self._scan: ScanData
        self._true: TruthSimulated
        self._goal = 0.0, 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Row, dict[str, Any]]:
        """A new robot at a random place, and a random goal: the same for the same seed."""
        super().reset(seed=seed)
        left, bottom, right, top = ROOM
        (x_m, goal_x_m), (y_m, goal_y_m) = (
            self.np_random.uniform(*ends, 2) for ends in ((left, right), (bottom, top))
        )
        start = Pose2D(x_m, y_m, self.np_random.uniform(-math.pi, math.pi))
        self._goal = goal_x_m, goal_y_m
        self._loop.run_until_complete(self._start(start, int(self.np_random.integers(2**31))))
        return self._observation(), {}

    def step(self, action: Row) -> tuple[Row, float, bool, bool, dict[str, Any]]:
        """Drive like that for 0.2 s."""
        before_m = self._distance_m()
        self._loop.run_until_complete(self._drive(action))
        left_m, touches = self._distance_m(), self._true.in_contact
        is_there = left_m < AT_GOAL_M
        reward = before_m - left_m + GOAL_REWARD * is_there - CONTACT_COST * touches
        ended = is_there or touches
        return self._observation(), float(reward), ended, False, {"distance_m": left_m}

    def close(self) -> None:
        """End the robot."""
        if not self._loop.is_closed():
            self._loop.run_until_complete(self._stack.aclose())
            self._loop.close()

    async def _start(self, start: Pose2D, noise: int) -> None:
        await self._stack.aclose()
        keys = {"x_m": start.x_m, "y_m": start.y_m, "heading_rad": start.heading_rad}
        overrides = {f"sim.world.start_{key}": value for key, value in keys.items()}
        settings = load(packaged("chefbot_lidar"), overrides={"sim.seed": noise, **overrides})
        self._robot = await self._stack.enter_async_context(simulated_robot(settings))
        self._scans = await self._stack.enter_async_context(self._robot.client.subscribe("scan"))
        await self._robot.client.wait_until_armed()
        await self._measure()

    async def _drive(self, action: Row) -> None:
        ahead, left = np.clip(np.asarray(action, np.float64), -1.0, 1.0).tolist()
        await self._robot.client.drive(FASTEST_M_S * ahead, FASTEST_RAD_S * left)
        await asyncio.sleep(STEP_S)
        await self._measure()

    async def _measure(self) -> None:
        self._scan = (await anext(self._scans)).data
        self._true = self._robot.board.truth(self._robot.now_s())

    def _distance_m(self) -> float:
        here = self._true.world_from_base
        return math.dist((here.x_m, here.y_m), self._goal)

    def _observation(self) -> Row:
        here, twist, (x_m, y_m) = self._true.world_from_base, self._true.twist, self._goal
        bearing_rad = wrap_angle(math.atan2(y_m - here.y_m, x_m - here.x_m) - here.heading_rad)
        nearest = nearest_m(points_of(self._scan), SECTORS) / REACH_M
        speeds = twist.linear_m_s / FASTEST_M_S, twist.angular_rad_s / FASTEST_RAD_S
        scaled = [*nearest, self._distance_m() / REACH_M, bearing_rad / math.pi, *speeds]
        return np.clip(np.array(scaled, np.float32), -1.0, 1.0)
