"""All parameters of navigation together."""

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.navigation.costmap import CostParameters
from chefbotd.navigation.evade import EvadeParameters
from chefbotd.navigation.live import LiveParameters
from chefbotd.navigation.outline import OutlineParameters
from chefbotd.navigation.people import PeopleParameters
from chefbotd.navigation.planner import PlannerParameters
from chefbotd.navigation.recovery import RecoveryParameters
from chefbotd.navigation.steering import FollowerParameters


class NavigationParameters(Parameters):
    """For one robot; only its outline must be told."""

    outline: OutlineParameters
    costs: CostParameters = CostParameters()
    live: LiveParameters = LiveParameters()
    people: PeopleParameters = PeopleParameters()
    planner: PlannerParameters = PlannerParameters()
    follower: FollowerParameters = FollowerParameters()
    evade: EvadeParameters = EvadeParameters()
    recovery: RecoveryParameters = RecoveryParameters()
    replan_s: float = Field(default=1.0, gt=0, le=60)
    better_share: float = Field(default=0.85, gt=0, le=1)
    """A new path is taken when it costs no more than this share of the present one, or when that is blocked."""
    turn_back_m: float = Field(default=1.0, ge=0, le=20)
    """Where there is no way but the blocked one, the robot drives on until it is so near to what blocks it."""
    near_m: float = Field(default=1.6, gt=0, le=20)
    """Points farther away than this are not looked at for the next motion."""
    idle_s: float = Field(default=6.0, gt=0, le=60)
    """A robot that drives and does not come on for so long is stuck."""
    scan_late_s: float = Field(default=0.3, gt=0, le=10)
    """By a scan that is older it drives more slowly: a busy computer, or a lidar that skips turns."""
    scan_silent_s: float = Field(default=0.6, gt=0, le=10)
    """Without a scan for so long the robot stands,"""
    scan_fault_s: float = Field(default=10.0, gt=0, le=60)
    """and after so much longer the goal ends."""
    pose_late_s: float = Field(default=0.2, gt=0, le=10)
    """With odometry that is older it drives more slowly,"""
    pose_silent_s: float = Field(default=0.4, gt=0, le=10)
    """and from here on it asks to stand: a board that was silent must not go on as before."""
    lost_s: float = Field(default=20.0, gt=0, le=600)
    """A robot that does not know where it is stands, and after so long the goal ends."""
    uncertain_speed_m_s: float = Field(default=0.12, gt=0, le=10)
