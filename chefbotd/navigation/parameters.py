"""What navigation is given: all else are constants beside their algorithms."""

from chefbotd.core.record import Record
from chefbotd.navigation.costmap import COMFORT_M
from chefbotd.navigation.outline import Footprint
from chefbotd.navigation.states import UnknownSpace
from chefbotd.navigation.steering import FollowerLimits


class NavigationParameters(Record, frozen=True):
    """What differs from robot to robot, and for a board that obeys late.

    Whatever takes its time takes ``slower`` times as long. By a scan that is older than ``scan_late_s`` the robot drives
    more slowly: a busy computer, or a lidar that skips turns. Without a scan for ``scan_silent_s`` it stands.
    The gate lets no rim go faster than ``silent_speed_m_s`` while the board waits for echoes that do not come (0: it
    stands then).
    """

    outline: Footprint
    follower: FollowerLimits = FollowerLimits()
    unknown_space: UnknownSpace = UnknownSpace.BLOCKED
    comfort_m: float = COMFORT_M
    slower: float = 1.0
    scan_late_s: float = 0.3
    scan_silent_s: float = 0.6
    silent_speed_m_s: float = 0.06
