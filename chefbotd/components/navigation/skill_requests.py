"""What the skill ``navigation`` is asked, and its steps; it tells the events of ``core.events.navigation``, too.

The daemon's side loads neither numpy nor a compiler.
"""

from pathlib import Path
from typing import Final, TypeAlias

import msgspec

from chefbotd.components.navigation.algorithms.arrival import ArrivalData
from chefbotd.components.navigation.events import GoalResult, NavigationData, PathData
from chefbotd.components.navigation.parameters import NavigationSection
from chefbotd.components.worker.messages import Message
from chefbotd.core.geometry import Twist2D
from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.motion.limits import MotionLimits

SKILL: Final = "navigation"


class NavigationSkillParameters(Parameters):
    """What the daemon tells the skill when it starts it: its section, no faster than the wheels can go.

    The robot's outline is a circle or a box about its origin.

    ``cameras`` are the depth cameras whose scans count beside those by which localization finds the way;
    ``range_mounts`` are the ultrasonic and infrared sensors: ``base_from_sensor`` (x, y, heading) by name.
    ``guard_stop_m`` before what is ahead, and ``guard_clearance_m`` all round: there the guards stop the robot.
    ``limits`` are the configured ones of the robot as a whole; None: nothing is known of them.
    ``silent_speed_m_s`` is what the gate lets a rim go while the board waits for echoes that do not come.
    """

    folder: Path
    radius_m: float | None
    half_length_m: float
    half_width_m: float
    navigation: NavigationSection
    silent_speed_m_s: float
    limits: MotionLimits | None = None
    guard_stop_m: float = 0.0
    guard_clearance_m: float = 0.0
    cameras: tuple[str, ...] = ()
    range_mounts: dict[str, tuple[float, float, float]] = {}


class GoalAsked(Message, frozen=True, tag="goal"):
    """A goal in the map in use, and the number that it has in the daemon."""

    number: int
    x_m: float
    y_m: float
    heading_rad: float | None
    tolerance_m: float
    max_speed_m_s: float | None = None


# Requests


class NavigateTo(Message, frozen=True, tag="navigate_to"):
    """Drive to these, one after the other; goals before them end, unless ``queue``."""

    goals: tuple[GoalAsked, ...]
    queue: bool


class KeepGoals(Message, frozen=True, tag="keep_goals"):
    """Keep only these goals, by the daemon's numbers; the daemon has published how the others ended."""

    numbers: tuple[int, ...]


class Pause(Message, frozen=True, tag="pause"):
    """Stand until ``Resume``; ``reason`` says why, ``said`` has its id and its arguments as JSON, where it has some."""

    reason: str
    said: str = ""


class Resume(Message, frozen=True, tag="resume"):
    """Go on."""


class PlanTo(Message, frozen=True, tag="plan_to"):
    """Tell what would be driven."""

    goal: GoalAsked


class Show(Message, frozen=True, tag="show"):
    """Send costs or obstacles from now on, or no more; first all of the costs, where a client begins to look."""

    costmap: bool
    obstacles: bool


class CheckMap(Message, frozen=True, tag="check_map"):
    """Tell whether there is something wrong with the map in use."""


class UseZones(Message, frozen=True, tag="use_zones"):
    """Read the zones of the map in use again, and plan by them; answered by ``MapChecked``."""


class Examine(Message, frozen=True, tag="examine"):
    """Tell what these zones or edits of the map in use, as its files have them, would do; None: they stay as they are.

    ``places`` are (x, y) in the map.
    """

    places: dict[str, tuple[float, float]]
    zones: bytes | None = None
    edits: bytes | None = None


NavigationRequest: TypeAlias = (
    NavigateTo | KeepGoals | Pause | Resume | PlanTo | Show | CheckMap | UseZones | Examine
)

# Answers and events


class MapChecked(Record, frozen=True):
    """Why nobody drives on the map in use; empty where nothing is wrong with it."""

    problem: str


class Examined(Record, frozen=True):
    """What zones or edits would do that may not be meant: a sentence each."""

    concerns: tuple[str, ...]


class Stepped(Record, frozen=True):
    """What navigation does, and the ``twist`` that it wishes the robot to have now (None: none), in one message.

    ``path`` is sent when it has changed, ``arrival`` when something new is thought of the last goal that was reached.
    """

    stamp_s: float
    twist: Twist2D | None
    now: NavigationData
    ended: tuple[GoalResult, ...]
    path: PathData | None
    arrival: ArrivalData | None = None


REQUEST: Final = msgspec.msgpack.Decoder(NavigationRequest)
