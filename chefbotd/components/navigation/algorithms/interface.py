"""What navigation takes and returns: its parameters, scans, the input of a step, and the result of a step."""

from enum import StrEnum

from chefbotd.components.navigation.algorithms.costmap import COMFORT_M, GuardDistances
from chefbotd.components.navigation.algorithms.evade import AGILE, Agility
from chefbotd.components.navigation.algorithms.grid import Floats, Singles
from chefbotd.components.navigation.algorithms.outline import Footprint
from chefbotd.components.navigation.algorithms.states import End, GoalState, UnknownSpace
from chefbotd.components.navigation.algorithms.steering import FollowerLimits
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import Record


class NavigationParameters(Record, frozen=True):
    """What differs from robot to robot, and for a board that obeys late.

    Time limits are ``slower`` times as long. With a scan that is older than ``scan_late_s`` (a busy computer, a lidar
    that skips turns) the robot drives more slowly; without one for ``scan_silent_s`` it stands. The gate lets no rim go
    faster than ``silent_speed_m_s`` while the board waits for echoes that do not come (0: it stands). ``guards`` are the
    distances at which the gate's guards stop it. ``agility`` is how fast the robot's limits let its speed change.
    """

    outline: Footprint
    follower: FollowerLimits = FollowerLimits()
    agility: Agility = AGILE
    unknown_space: UnknownSpace = UnknownSpace.BLOCKED
    comfort_m: float = COMFORT_M
    guards: GuardDistances = GuardDistances(stop_m=0.05, clearance_m=0.02)
    slower: float = 1.0
    scan_late_s: float = 0.3
    scan_silent_s: float = 0.6
    silent_speed_m_s: float = 0.06


class PoseStatus(StrEnum):
    """How well the pose is known."""

    LOCALIZED = "localized"
    UNCERTAIN = "uncertain"
    LOST = "lost"


class Seen(Record, frozen=True):
    """A scan: points (n, 2) in the robot's frame, in the order of their beams, and the robot's pose at its time.

    ``sensor_m`` is where the lidar is on the robot (2,), or where each point was seen from (n, 2).
    """

    stamp_s: float
    map_from_base: Pose2D
    sensor_m: Floats | Singles
    points_m: Floats


class StepInput(Record, frozen=True):
    """The input of a step: the time, the time since the last step, the robot's pose (``map_from_base``).

    ``last`` is the twist that was commanded last. ``pose_age_s`` is for how long no odometry came: since then the pose
    is predicted.
    """

    now_s: float
    dt_s: float
    pose: Pose2D
    status: PoseStatus
    last: Twist2D
    pose_age_s: float = 0.0


class Progress(Record, frozen=True):
    """The state of a goal: ``goal`` is its number, ``reason`` a sentence, distance and time what is left."""

    state: GoalState
    goal: int | None = None
    reason: str = ""
    distance_m: float | None = None
    time_s: float | None = None


class Ended(Record, frozen=True):
    """A goal's end."""

    goal: int
    end: End
    reason: str


class Step(Record, frozen=True):
    """The twist to command (None: no command, so no lease is needed), the progress, and the goals that ended."""

    twist: Twist2D | None
    progress: Progress
    ended: tuple[Ended, ...] = ()
