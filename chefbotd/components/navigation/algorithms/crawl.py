"""Drives while the board is silent for a second in every cycle: one slow motion for each reading.

The classic board says nothing and obeys nothing while it waits for an echo, and obeys up to two cycles late. So each
reading leads to one motion, which is held until the next. It begins where the two motions that were asked for before it
will have taken the robot (a Smith predictor), and is so slow that the robot comes to the place of that motion in one
cycle.
"""

import math

from chefbotd.components.navigation.algorithms.interface import NavigationParameters
from chefbotd.core.geometry import STANDING, Pose2D, Twist2D
from chefbotd.core.record import Record, replace

CYCLE_S, WAIT_S = 1.05, 1.0
"""A cycle of the board, and for how long of it it waits for the echo; then what it read when it began is in force."""

SETTLED_S = 0.1
"""The robot decides by a reading of this age: by then the scans of its time have arrived."""

AGAIN_S = 0.5
"""A silence that begins so soon after another one belongs to a board that is silent in every cycle."""

ENDED_S = 1.0
"""After so long without a silence the board obeys at once again."""

SPEED_SHARE, TURN_PER_M, CURVE_TURN_PER_M = 2 / 3, 10 / 3, 2.0
"""Of the speed of a rim that the gate allows, this share is used for driving, and so many rad/s per m/s for turning."""

LEAST_SPEED_M_S, LEAST_TURN_RAD_S = 0.02, 0.08
"""Wheels that are commanded to turn more slowly for one cycle may not begin to turn."""

POSITION_M, HEADING_RAD = 0.025, 0.045
"""The goal's tolerances: half of what one cycle of the least motion changes, and still what is promised."""

SLOWER = 6.0
"""Time limits are so many times as long."""


class Crawl(Record, frozen=True):
    """Silences of the odometry (when the last one began and ended), and the motions asked for, the newest first.

    ``decided_s`` is the time of the reading that the newest one was decided by.
    """

    silent_from_s: float = -math.inf
    silent_until_s: float = -math.inf
    is_on: bool = False
    decided_s: float = -math.inf
    asked: tuple[Twist2D, Twist2D] = (STANDING, STANDING)

    @property
    def rests(self) -> bool:
        """Whether the robot will stand when the next motion begins."""
        return self.asked == (STANDING, STANDING)

    def is_due(self, read_s: float, now_s: float) -> bool:
        """Whether there is a reading that nothing was decided by."""
        return read_s > self.decided_s + AGAIN_S / 2 and now_s - read_s >= SETTLED_S

    def predicted(self, pose: Pose2D) -> Pose2D:
        """Where the motion before the last one will have taken the robot; the last one is the follower's to predict."""
        return move_pose(pose, self.asked[1], WAIT_S)

    def then(self, read_s: float, twist: Twist2D) -> "Crawl":
        """The same with the next motion."""
        return replace(self, decided_s=read_s, asked=(twist, self.asked[0]))


def watch_silence(last: Crawl, read_s: float, now_s: float, silent_s: float, asked: Twist2D) -> Crawl:
    """Whether the board is silent in every cycle; ``asked`` is what was asked for last."""
    if now_s - read_s < silent_s:
        if last.is_on and now_s - last.silent_until_s > ENDED_S:
            return Crawl()
        return last
    if read_s < last.silent_until_s:  # the same silence goes on
        return replace(last, silent_until_s=now_s)
    if read_s - last.silent_until_s > AGAIN_S:
        return Crawl(silent_from_s=now_s, silent_until_s=now_s)
    asks = last.asked if last.is_on else (asked, asked)
    return replace(last, silent_from_s=now_s, silent_until_s=now_s, is_on=True, asked=asks)


def move_pose(pose: Pose2D, twist: Twist2D, for_s: float) -> Pose2D:
    """A pose after a motion."""
    turned, along_m = twist.angular_rad_s * for_s, twist.linear_m_s * for_s
    return pose.compose(Pose2D(along_m * math.cos(turned / 2), along_m * math.sin(turned / 2), turned))


def slow_for_silence(params: NavigationParameters) -> NavigationParameters:
    """The same for such a board: what is asked for is driven for one cycle, whatever it was before."""
    usual, rim_m_s = params.follower, params.silent_speed_m_s
    speed_m_s, turn_rad_s = SPEED_SHARE * rim_m_s, TURN_PER_M * rim_m_s
    follower = replace(
        usual,
        max_speed_m_s=min(speed_m_s, usual.max_speed_m_s),
        max_reverse_m_s=min(speed_m_s, usual.max_reverse_m_s),
        max_turn_rad_s=min(turn_rad_s, usual.max_turn_rad_s),
        curve_turn_rad_s=min(CURVE_TURN_PER_M * rim_m_s, usual.curve_turn_rad_s),
        acceleration_m_s2=10.0,
        deceleration_m_s2=10.0,
        turn_acceleration_rad_s2=20.0,
        delay_s=CYCLE_S,
        least_speed_m_s=min(LEAST_SPEED_M_S, speed_m_s),
        least_turn_rad_s=min(LEAST_TURN_RAD_S, turn_rad_s),
        position_m=POSITION_M,
        heading_rad=HEADING_RAD,
    )
    return replace(params, follower=follower, slower=SLOWER, scan_late_s=CYCLE_S, scan_silent_s=2 * CYCLE_S)
