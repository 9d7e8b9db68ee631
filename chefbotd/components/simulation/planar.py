"""The simulated robot in the plane: a disc on wheels that roll as their motors turn, and that walls and people stop."""

import math

from chefbotd.components.simulation.crowd import Crowd
from chefbotd.components.simulation.ground import Backlash, Slip
from chefbotd.components.simulation.parameters.motor import SimBodyParameters
from chefbotd.components.simulation.plant import Plant, WheelState
from chefbotd.components.simulation.robot import TOUCH_M, Robot, RobotState
from chefbotd.components.simulation.sensors import Battery
from chefbotd.components.simulation.world import World
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D

STRAIGHT_RAD = 1e-9


class PlanarRobot(Robot):
    """A disc on wheels. A push acts on the wheels: what is sideways moves nothing."""

    def __init__(
        self,
        plant: Plant,
        body: SimBodyParameters,
        world: World,
        battery: Battery,
        start: Pose2D,
        backlash: Backlash,
        slip: Slip,
        crowd: Crowd | None = None,
    ) -> None:
        """Raises ``ValueError`` when the start pose is closer to a wall than the robot's radius."""
        free_m = free_at(start, world, body)
        idle_v, _ = plant.load(plant.standing, None, battery.supply)
        state = RobotState(start, STANDING, plant.standing, battery, idle_v, free_m)
        super().__init__(plant, body, state, slip, crowd or Crowd((), (), seed=0))
        self._world, self._backlash = world, backlash

    def _step(self, state: RobotState) -> RobotState:
        supply = state.battery.supply
        terminal_v, drawn_a = self._plant.load(state.wheels, self._pulse_width, supply)
        battery = state.battery.drained(drawn_a, self._plant.step_s)
        wheels = self._plant.step(state.wheels, self._pulse_width, terminal_v, state.skid, self._pushed_now)
        return self._moved(state, wheels, battery, terminal_v)

    def _moved(
        self, state: RobotState, wheels: WheelState, battery: Battery, terminal_v: float
    ) -> RobotState:
        """The robot after its wheels have turned, stopped by walls where they are in its way."""
        step_s, before = self._plant.step_s, state.world_from_base
        if wheels is state.wheels and state.twist == STANDING and not len(self._world.discs):
            turned_rad = state.turned_rad
            return RobotState(
                before, STANDING, wheels, battery, terminal_v, state.free_m, turned_rad=turned_rad
            )
        played_rad = self._backlash.turned_rad(state.wheels.angle_rad, wheels.angle_rad)
        rolled_rad = self.slip.gripped(played_rad)
        twist = self._plant.twist([angle / step_s for angle in rolled_rad])
        twist = self.slip.disturbed(twist, step_s)
        target = before.compose(arc(twist, step_s))
        pose, free_m = self._let_through(state, target)
        touches_disc = False
        if len(self._world.discs):
            pose, free_m, touches_disc = self._among_discs(state, pose, free_m)
        skid = 0.0
        if pose is not target:
            skid = max(1 - _distance_m(before, pose) / max(_distance_m(before, target), TOUCH_M), 0.0)
            forward_m = before.inverse().compose(pose).x_m
            twist = Twist2D(forward_m / step_s, twist.angular_rad_s)
        forward_m_s2 = (twist.linear_m_s - state.twist.linear_m_s) / step_s
        turned_rad = state.turned_rad + twist.angular_rad_s * step_s
        return RobotState(
            pose, twist, wheels, battery, terminal_v, free_m, forward_m_s2, skid, touches_disc, turned_rad
        )

    def _let_through(self, state: RobotState, target: Pose2D) -> tuple[Pose2D, float]:
        """Where the walls let the robot go (``target`` itself if there), and how far it may go from there.

        The walls are looked at only when the robot may have used up its last clearance.
        """
        before = state.world_from_base
        travel_m = _distance_m(before, target)
        if travel_m <= state.free_m - TOUCH_M or travel_m == 0:  # less would count as a touch
            return target, state.free_m - travel_m
        radius_m = self._body.radius_m
        place = self._world.settle((before.x_m, before.y_m), (target.x_m, target.y_m), radius_m)
        free_m = self._world.clearance_m(place) - radius_m
        if place == (target.x_m, target.y_m):
            return target, free_m
        return Pose2D(*place, target.heading_rad), free_m

    def _among_discs(self, state: RobotState, target: Pose2D, free_m: float) -> tuple[Pose2D, float, bool]:
        """Where people and things let the robot go, how far it may go from there, and whether it touches one."""
        radius_m, before = self._body.radius_m, state.world_from_base
        here, target_place = (before.x_m, before.y_m), (target.x_m, target.y_m)
        place, touches = self._world.keep_off(here, target_place, radius_m)
        if place == target_place:
            return target, free_m, touches
        free_m = self._world.clearance_m(place) - radius_m
        return Pose2D(*place, target.heading_rad), free_m, touches


def free_at(start: Pose2D, world: World, body: SimBodyParameters) -> float:
    """How far the robot may go from its start before it touches a wall.

    Raises:
        ValueError: the start is closer to a wall than the robot's radius.
    """
    clearance_m = world.clearance_m((start.x_m, start.y_m))
    if clearance_m < body.radius_m:
        raise ValueError(
            f"start pose {start} is {clearance_m:.3f} m from a wall, robot radius {body.radius_m} m"
        )
    return clearance_m - body.radius_m


def _distance_m(a: Pose2D, b: Pose2D) -> float:
    return math.hypot(b.x_m - a.x_m, b.y_m - a.y_m)


def arc(twist: Twist2D, duration_s: float) -> Pose2D:
    """The exact displacement by a constant twist, as ``before_from_after``."""
    turned_rad = twist.angular_rad_s * duration_s
    travelled_m = twist.linear_m_s * duration_s
    if abs(turned_rad) < STRAIGHT_RAD:
        return Pose2D(travelled_m, 0.0, turned_rad)
    radius_m = travelled_m / turned_rad
    return Pose2D(radius_m * math.sin(turned_rad), radius_m * (1 - math.cos(turned_rad)), turned_rad)
