"""The inputs of navigation for a scan and for a step, and the results of each step."""

from enum import StrEnum

from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import Record
from chefbotd.navigation.distance import Singles
from chefbotd.navigation.grid_frame import Floats
from chefbotd.navigation.states import End, State


class PoseStatus(StrEnum):
    """How well the pose is known."""

    LOCALIZED = "localized"
    UNCERTAIN = "uncertain"
    LOST = "lost"


class Seen(Record, frozen=True):
    """A scan: points (n, 2) in the robot's frame, in the order of their beams, and where it was then.

    ``sensor_m`` is where the lidar is on the robot (2,), or for each point where it was seen from (n, 2).
    """

    stamp_s: float
    map_from_base: Pose2D
    sensor_m: Floats | Singles
    points_m: Floats


class StepInput(Record, frozen=True):
    """What a step is made with: the time, the time since the last step, where the robot is (``map_from_base``).

    ``last`` is the twist that was asked for last. ``pose_age_s`` is for how long no odometry came: since then the pose
    is only expected.
    """

    now_s: float
    dt_s: float
    pose: Pose2D
    status: PoseStatus
    last: Twist2D
    pose_age_s: float = 0.0


class Progress(Record, frozen=True):
    """What is told of a goal: ``goal`` is its number, ``reason`` a sentence, distance and time what is left."""

    state: State
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
    """The twist that is wanted (None: nothing is, and no lease is needed), progress, and goals that ended."""

    twist: Twist2D | None
    progress: Progress
    ended: tuple[Ended, ...] = ()
