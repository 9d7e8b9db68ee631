"""The simulated robot: motors, battery and surroundings together, stepped on a fixed grid of time.

What a step does is up to the physics (``planar.py``, ``mujoco_robot.py``). State exists at whole steps only. A reading
between two steps is interpolated; a command between two steps acts from the second. So when and how often the robot is
advanced never changes what it does.
"""

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence

from chefbotd.components.simulation.axles import Wheels
from chefbotd.components.simulation.crowd import Crowd
from chefbotd.components.simulation.ground import Slip
from chefbotd.components.simulation.parameters.motor import SimBodyParameters
from chefbotd.components.simulation.plant import Plant, Push, WheelState
from chefbotd.components.simulation.sensors import Battery, ImuMotion, Tilt
from chefbotd.core.events import TruthSimulated
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import Record, replace

Watcher = Callable[[float, float, Wheels, Wheels], None]
"""Called at every step with its begin and end, and the wheels' angles before and after it."""

TRAIL_S = 0.5
TOUCH_M = 1e-6


class RobotState(Record, frozen=True):
    """Everything about the robot at one step.

    ``free_m`` is how far it can certainly move before it touches a wall; ``skid`` is the share of its motion that a
    wall takes away; ``turned_rad`` is how far it has turned since power-on, without wrapping.
    ``tilt`` None: the robot stays level.
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
    tilt: Tilt | None = None

    @property
    def in_contact(self) -> bool:
        """Whether the robot touches a wall, a thing or a person."""
        return self.free_m < TOUCH_M or self.touches_disc


class Robot(ABC):
    """A robot on wheels between walls, and among people; ``_step`` is its physics.

    ``slip`` says how the wheels grip, and may be changed. ``trail`` has the last poses (time, x, y, heading), a step
    apart, the newest last.
    """

    def __init__(
        self,
        plant: Plant,
        body: SimBodyParameters,
        state: RobotState,
        slip: Slip,
        crowd: Crowd,
    ) -> None:
        self._plant, self._body, self.slip, self._crowd = plant, body, slip, crowd
        self._push, self._pushed_until_s = Push(), 0.0
        self._pulse_width: Wheels | None = None
        self._now = self._before = state
        self._steps = 0
        self._read_s = 0.0
        self._watchers: list[Watcher] = []
        steps = math.ceil(TRAIL_S / plant.step_s) + 1
        self.trail: deque[tuple[float, float, float, float]] = deque(maxlen=steps)
        self._leave_trail(state.world_from_base)

    def _leave_trail(self, pose: Pose2D) -> None:
        self.trail.append((self._steps * self._plant.step_s, pose.x_m, pose.y_m, pose.heading_rad))

    @property
    def step_s(self) -> float:
        """How long a step is: in between the wheels turn evenly, and a command does nothing."""
        return self._plant.step_s

    def drive(self, shares: Sequence[float]) -> None:
        """Set the PWM shares (-1 to 1) of the wheels; 0 brakes. Raises ``ValueError`` unless there is one per wheel."""
        self._pulse_width = self._plant.pulse_width(shares)

    def release(self) -> None:
        """Open the bridges: the motors coast."""
        self._pulse_width = None

    def push(self, push: Push, duration_s: float) -> None:
        """Push the robot from now on for so long, in the place of an earlier push."""
        self._push, self._pushed_until_s = push, self._read_s + duration_s

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

    @abstractmethod
    def _step(self, state: RobotState) -> RobotState:
        """The robot a step later; its crowd has moved already."""

    @property
    def _pushed_now(self) -> Push | None:
        """What pushes it during the next step."""
        return self._push if self._steps * self._plant.step_s < self._pushed_until_s else None

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
    def motion(self) -> ImuMotion:
        """The motion that its IMU measures."""
        state = self._now
        sideways = state.twist.linear_m_s * state.twist.angular_rad_s
        motion = ImuMotion(
            state.world_from_base.heading_rad,
            state.twist.angular_rad_s,
            state.forward_m_s2,
            sideways,
            state.turned_rad,
        )
        return motion if state.tilt is None else replace(motion, tilt=state.tilt)

    def truth(self, stamp_s: float) -> TruthSimulated:
        """The true pose and motion, with this stamp."""
        state = self._now
        discs = tuple([(x, y, radius) for x, y, radius in self._crowd.discs.tolist()])
        return TruthSimulated(stamp_s, state.world_from_base, state.twist, state.in_contact, discs)
