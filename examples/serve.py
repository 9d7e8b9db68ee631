"""``chefbotctl serve``: a simulated ChefBot localizes itself, drives to three tables, and comes home."""

import asyncio
import math
import tempfile
from pathlib import Path
from typing import Final

import chefbotd.components.simulation.worlds
from chefbotd.cli.common.context import CommandContext, beside
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.drive.simulated_daemon import simulated_daemon, until_ready
from chefbotd.client import Client
from chefbotd.client.errors import GoalNotReached
from chefbotd.components.maps.cli.draw import MapMark
from chefbotd.components.navigation.cli.view import PLACE, NavigationScene, Show, listen
from chefbotd.components.simulation.parameters.motor import SimBodyParameters
from chefbotd.components.simulation.scene import of_solids
from chefbotd.components.simulation.worlds.flat import FLAT
from chefbotd.core.geometry import Pose2D, wrap_angle
from examples import order
from examples.legs import Best, Leg, Truth, ended_leg, standing_text
from examples.robot_time import RobotTime
from examples.serve_report import Found, Served

MAP: Final = Path(chefbotd.components.simulation.worlds.__file__).parent / "flat.yaml"
LOOK_S, LOOK_RAD_S, FOUND_S = 4.0, 0.5, 40.0
"""It looks for so long while it stands; then it turns, so that it sees from more sides."""

LEG_S, ORDER_S = 75.0, 300.0
"""The longest time for one leg, and for the whole order from the loaded map on, which takes two minutes.

All times are by the robot's clock, which a busy computer slows down.
"""

TRUTH_HZ = 25.0


class Serve:
    """One run; ``show`` is called with each change."""

    def __init__(self, places: tuple[str, ...], show: Show) -> None:
        self._places, self._show = places, show
        self._scene = NavigationScene(doing="starting the simulated robot")
        body = SimBodyParameters()
        world = of_solids(FLAT.solids).below(body.height_m)
        self._truth = Truth(world, body.radius_m)
        chair = (order.CHAIR.x_m, order.CHAIR.y_m, order.CHAIR.radius_m)
        self._time, self._due_s = RobotTime(), math.inf
        self._best = Best(FLAT.grid(), [chair], body.radius_m)

    async def run(self) -> Served:
        """Start the robot, and have the order carried out.

        Raises:
            ProgramError: it could not be begun with, and why. A leg that fails is in the result.
        """
        self._show(self._scene)
        with tempfile.TemporaryDirectory(prefix="chefbotctl-") as folder:
            environment = order.environment(Path(folder) / "maps")
            async with simulated_daemon("chefbot_lidar", environment, own_clock=True) as (where, _):
                return await CommandContext(where).with_client(self._with_robot)

    async def _with_robot(self, robot: Client) -> Served:
        await until_ready(robot, self._say)
        async with beside(self._watch_truth(robot), listen(robot, self._scene, self._show)):
            await self._time.until_first()
            began_s = self._time.now_s
            await self._load_map(robot)
            self._due_s = self._time.now_s + ORDER_S
            start = await self._find(robot)
            legs: list[Leg] = []
            for place in self._places:
                legs.append(await self._leg(robot, place))
                if legs[-1].end != "reached":
                    break
        return Served(start, tuple(legs), self._time.now_s - began_s, self._time.late_text())

    async def _watch_truth(self, robot: Client) -> None:
        async with robot.subscribe("sim", max_rate_hz=TRUTH_HZ) as events:
            async for event in events:
                data = event.data
                discs = tuple((disc.x_m, disc.y_m, disc.radius_m) for disc in data.discs)
                pose = Pose2D(data.x_m, data.y_m, data.heading_rad)
                self._truth.add_pose(pose, discs, in_contact=data.in_contact)
                self._scene.discs = discs
                self._time.take_stamp(event.stamp_s)

    async def _load_map(self, robot: Client) -> None:
        self._say("loading the map of the flat")
        await robot.import_map(str(MAP), FLAT.name)
        for name, pose in order.PLACES.items():
            await robot.save_place(name, pose.x_m, pose.y_m, pose.heading_rad, of_map=FLAT.name)
        await robot.load_map(FLAT.name)
        self._scene.grid = (await robot.get_map(FLAT.name)).grid()
        self._scene.places = tuple(
            MapMark(pose.x_m, pose.y_m, label=name, style=PLACE) for name, pose in order.PLACES.items()
        )

    # where it is

    async def _find(self, robot: Client) -> Found:
        """Wait until it knows where it is; after a while it turns, so that it sees more.

        Raises:
            ProgramError: it did not find out.
        """
        self._say("finding out where it is")
        began_s, turns = self._time.now_s, False
        try:
            async with self._time.timeout(FOUND_S):
                while self._scene.localization != "localized" or self._scene.tracker.pose is None:
                    await asyncio.sleep(0.1)
                    if self._time.now_s - began_s > LOOK_S:
                        turns = True
                        await robot.drive(0.0, LOOK_RAD_S)
        except TimeoutError:
            reason = f"it did not find out where it is within {FOUND_S:g} s: {self._scene.localization}"
            raise ProgramError(Exit.NOT_DONE, reason) from None
        took_s = self._time.now_s - began_s
        if turns:
            await robot.stop()
            await robot.release_control()
            await self._time.sleep(1.0)
        return self._start_of(took_s, turned=turns)

    def _start_of(self, took_s: float, *, turned: bool) -> Found:
        pose, true = self._scene.tracker.pose, self._truth.pose
        if pose is None or true is None:
            raise ProgramError(Exit.NOT_DONE, "the pose of the robot is not known")
        off_m = math.dist((pose.x_m, pose.y_m), (true.x_m, true.y_m))
        return Found(took_s, off_m, abs(wrap_angle(pose.heading_rad - true.heading_rad)), turned)

    # legs

    async def _leg(self, robot: Client, place: str) -> Leg:
        """Send it to a place, and wait for the end."""
        self._say(f"to {place}" if place in order.TABLES else f"home to the {place}")
        self._truth.begin_leg()
        start, began_s = self._truth.pose or order.START, self._time.now_s
        end = await self._end_of(robot, place)
        seconds = self._time.now_s - began_s
        await self._time.sleep(0.3)  # it stands, and the truth of that has arrived
        return ended_leg(place, start, order.PLACES[place], end, seconds, self._truth, self._best)

    async def _end_of(self, robot: Client, place: str) -> tuple[str, str]:
        limit_s = max(1.0, min(LEG_S, self._due_s - self._time.now_s))
        try:
            async with self._time.timeout(limit_s):
                return "reached", await robot.navigate_to(place=place)
        except GoalNotReached as error:
            return error.end, error.reason
        except TimeoutError:
            where = standing_text(self._truth, order.PLACES[place])
            await robot.cancel_navigation()
            last = self._scene.reason or self._scene.state
            return "timed out", f"not there within {limit_s:.0f} s; last: {last}; {where}"

    def _say(self, doing: str) -> None:
        late = self._time.late_text()
        self._scene.doing = f"{doing} ({late})" if late else doing
        self._show(self._scene)
