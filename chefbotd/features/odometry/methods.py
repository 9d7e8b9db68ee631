"""Odometry: the topic ``odometry``, and the method that sets the pose."""

from typing import Final, Literal, Protocol

from pydantic import Field

from chefbotd.core.events import OdometryUpdated
from chefbotd.core.geometry import Pose2D
from chefbotd.rpc.method import Caller, method
from chefbotd.rpc.models import DONE, Done, Params, TopicData
from chefbotd.rpc.roles import Role
from chefbotd.rpc.topics import Topic

FARTHEST_M: Final = 1e6  # a slip of the finger, beyond; within, a double tells 0.1 nm


class ResetOdometryParams(Params):
    """Where the robot now stands in ``odom``."""

    x_m: float = Field(0.0, ge=-FARTHEST_M, le=FARTHEST_M)
    y_m: float = Field(0.0, ge=-FARTHEST_M, le=FARTHEST_M)
    heading_rad: float = Field(0.0, description="CCW positive; taken modulo a turn")


class OdometryData(TopicData):
    """Dead reckoning: the base's pose in ``odom``, its twist in its own frame."""

    x_m: float
    y_m: float
    heading_rad: float = Field(description="CCW positive, in (-pi, pi]")
    linear_m_s: float
    angular_rad_s: float
    covariance: tuple[float, ...] = Field(description="3x3, row by row, over x, y, heading")
    frame_id: Literal["odom"] = "odom"
    child_frame_id: Literal["base_footprint"] = "base_footprint"


class Odometry(Protocol):
    """What keeps the pose."""

    def set_pose(self, odom_from_base: Pose2D) -> None:
        """Declare where the robot is."""
        ...


class OdometryMethods:
    """The methods of this feature."""

    def __init__(self, odometry: Odometry) -> None:
        self._odometry = odometry

    @method(role=Role.DRIVE, moves=False)
    def reset_odometry(self, caller: Caller, params: ResetOdometryParams) -> Done:
        """Set the robot's pose in odom; the default is the origin."""
        self._odometry.set_pose(Pose2D(params.x_m, params.y_m, params.heading_rad))
        return DONE


def _odometry(event: OdometryUpdated) -> OdometryData:
    return OdometryData(
        x_m=event.odom_from_base.x_m,
        y_m=event.odom_from_base.y_m,
        heading_rad=event.odom_from_base.heading_rad,
        linear_m_s=event.twist.linear_m_s,
        angular_rad_s=event.twist.angular_rad_s,
        covariance=event.covariance.row_by_row,
    )


TOPICS = (Topic("odometry", (OdometryUpdated,), OdometryData, _odometry),)
