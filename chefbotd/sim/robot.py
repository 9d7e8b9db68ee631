"""The simulated robot: motors, battery and walls together, stepped on a fixed grid of time.

State exists at whole steps only. A reading between two steps is interpolated; a command between two steps acts from
the second. So when and how often the robot is advanced never changes what it does.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence

from chefbotd.core.events import TruthSimulated
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D
from chefbotd.core.record import Record
from chefbotd.sim.crowd import Crowd
from chefbotd.sim.ground import Backlash, Slip
from chefbotd.sim.plant import Plant, Wheels, WheelState
from chefbotd.sim.sensors import Battery, Motion
from chefbotd.sim.world import World
from chefbotd.sim_parameters.motor import SimBodyParameters

Watcher = Callable[[float, float, Wheels, Wheels], None]
"""Called at every step with its begin and end, and the wheels' angles before and after it."""

STRAIGHT_RAD = 1e-9
TRAIL_S = 0.5
TOUCH_M = 1e-6


class RobotState(Record, frozen=True):
    """Everything about the robot at one step.

    ``free_m`` is how far it can certainly move before it touches a wall; ``skid`` is the share of its motion that a
    wall takes away; ``turned_rad`` is how far it has turned since power-on, without wrapping.
    """

    world_from_base: Pose2D
    twist: Twist2D
    wheels: WheelState
    battery: Battery
    terminal_v: float
    free_m: float
    forward_m_s2: float = 0.0
    skid: float = 0.0
    touches_disc: bool = False
    turned_rad: float = 0.0

    @property
    def in_contact(self) -> bool:
        """Whether the robot touches a wall, a thing or a person."""
        return self.free_m < TOUCH_M or self.touches_disc


class Robot:
    """A disc on wheels between walls, and among people.

    ``slip`` says how the wheels grip, and may be changed. ``trail`` has the last poses (time, x, y, heading), a step
    apart, the newest last.
    """

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
        clearance_m = world.clearance_m((start.x_m, start.y_m))
        if clearance_m < body.radius_m:
            raise ValueError(
                f"start pose {start} is {clearance_m:.3f} m from a wall, robot radius {body.radius_m} m"
            )
        self._plant, self._body, self._world = plant, body, world
        self._backlash, self.slip = backlash, slip
        self._crowd = crowd or Crowd((), (), seed=0)
        self._pulse_width: Wheels | None = None
        idle_v, _ = plant.load(plant.standing, None, battery.supply)
        self._now = self._before = RobotState(
            start, STANDING, plant.standing, battery, idle_v, clearance_m - body.radius_m
        )
        self._steps = 0
        self._read_s = 0.0
        self._watchers: list[Watcher] = []
        steps = math.ceil(TRAIL_S / plant.step_s) + 1
        self.trail: deque[tuple[float, float, float, float]] = deque(maxlen=steps)
        self._leave_trail(start)

    def _leave_trail(self, pose: Pose2D) -> None:
        self.trail.append((self._steps * self._plant.step_s, pose.x_m, pose.y_m, pose.heading_rad))

    def drive(self, shares: Sequence[float]) -> None:
        """Set the PWM shares (-1 to 1) of the wheels; 0 brakes. Raises ``ValueError`` unless there is one per wheel."""
        self._pulse_width = self._plant.pulse_width(shares)

    def release(self) -> None:
        """Open the bridges: the motors coast."""
        self._pulse_width = None

    def watch(self, watcher: Watcher) -> None:
        """Call this watcher at every step from now on."""
        self._watchers.append(watcher)

    def advance(self, to_s: float) -> None:
        """Advance the robot to this time, for the readings below. An earlier time changes nothing."""
        self._read_s = max(to_s, self._read_s)
        step_s = self._plant.step_s
        while self._steps * step_s < self._read_s:
            self._crowd.step(step_s, self._now.world_from_base, self._body.radius_m)
            self._before, self._now = self._now, self._step(self._now)
            self._steps += 1
            self._leave_trail(self._now.world_from_base)
            for watcher in self._watchers:
                to_step_s = self._steps * step_s
                watcher(
                    to_step_s - step_s, to_step_s, self._before.wheels.angle_rad, self._now.wheels.angle_rad
                )

    @property
    def wheel_angles_rad(self) -> Wheels:
        """How far each wheel has turned since power-on."""
        behind = (self._steps * self._plant.step_s - self._read_s) / self._plant.step_s
        steps = zip(self._now.wheels.angle_rad, self._before.wheels.angle_rad, strict=True)
        return tuple([now - (now - before) * behind for now, before in steps])

    @property
    def state(self) -> RobotState:
        """The robot at the first step that ends at its present time or later."""
        return self._now

    @property
    def crowd(self) -> Crowd:
        """People and things around the robot."""
        return self._crowd

    @property
    def motion(self) -> Motion:
        """The motion that its IMU measures."""
        state = self._now
        sideways = state.twist.linear_m_s * state.twist.angular_rad_s
        return Motion(
            state.world_from_base.heading_rad,
            state.twist.angular_rad_s,
            state.forward_m_s2,
            sideways,
            state.turned_rad,
        )

    def truth(self, stamp_s: float) -> TruthSimulated:
        """The true pose and motion, with this stamp."""
        state = self._now
        discs = tuple([(x, y, radius) for x, y, radius in self._crowd.discs.tolist()])
        return TruthSimulated(stamp_s, state.world_from_base, state.twist, state.in_contact, discs)

    def _step(self, state: RobotState) -> RobotState:
        supply = state.battery.supply
        terminal_v, drawn_a = self._plant.load(state.wheels, self._pulse_width, supply)
        battery = state.battery.drained(drawn_a, self._plant.step_s)
        wheels = self._plant.step(state.wheels, self._pulse_width, terminal_v, state.skid)
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
        """Where the walls let the robot go (``wanted`` itself if there), and how far it may go from there.

        The walls are looked at only when the robot may have used up its last clearance.
        """
        before = state.world_from_base
        travel_m = _distance_m(before, target)
        if travel_m < state.free_m or travel_m == 0:
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
