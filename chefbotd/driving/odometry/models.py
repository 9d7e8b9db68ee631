"""Odometry: the topic ``odometry``, and where the robot is declared to be."""

from typing import Annotated, Final, Literal

from msgspec import Meta
from pydantic import Field

from chefbotd.core.events import OdometryConditionChanged, OdometryConditionData, OdometryUpdated
from chefbotd.core.record import Record
from chefbotd.rpc.models import Params
from chefbotd.rpc.topics import Topic, same_names

FARTHEST_M: Final = 1e6  # a slip of the finger, beyond; within, a double tells 0.1 nm


class ResetOdometryParams(Params):
    """The robot's present pose in ``odom``."""

    x_m: float = Field(0.0, ge=-FARTHEST_M, le=FARTHEST_M)
    y_m: float = Field(0.0, ge=-FARTHEST_M, le=FARTHEST_M)
    heading_rad: float = Field(0.0, description="CCW positive; taken modulo a turn")


class OdometryData(Record, frozen=True):
    """Dead reckoning: the base's pose in ``odom``, its twist in its own frame."""

    x_m: float
    y_m: float
    heading_rad: Annotated[float, Meta(description="CCW positive, in (-pi, pi]")]
    linear_m_s: float
    angular_rad_s: float
    covariance: Annotated[tuple[float, ...], Meta(description="3x3, row by row, over x, y, heading")]
    frame_id: Literal["odom"] = "odom"
    child_frame_id: Literal["base_footprint"] = "base_footprint"


def _odometry(event: OdometryUpdated) -> OdometryData:
    return OdometryData(
        x_m=event.odom_from_base.x_m,
        y_m=event.odom_from_base.y_m,
        heading_rad=event.odom_from_base.heading_rad,
        linear_m_s=event.twist.linear_m_s,
        angular_rad_s=event.twist.angular_rad_s,
        covariance=event.covariance.row_by_row,
    )


TOPICS = (
    Topic("odometry", (OdometryUpdated,), OdometryData, _odometry, for_guests=True),
    Topic(
        "odometry_condition",
        (OdometryConditionChanged,),
        OdometryConditionData,
        same_names(OdometryConditionData),
        always_known=True,
    ),
)
