"""Dead reckoning: every measured turn of the wheels becomes an ``OdometryUpdated``.

The source is the wheels alone, the wheels with the IMU, or the speeds that the wheels were commanded.
"""

import math
from functools import partial

import structlog

from chefbotd.bus import Bus, HandlerFailure
from chefbotd.clock import Clock
from chefbotd.core.events import (
    BoardRestarted,
    ImuMeasured,
    ImuTrust,
    LinkClosed,
    MotionAnomaly,
    OdometryConditionChanged,
    OdometryReset,
    OdometryUpdated,
    WheelsDriven,
    WheelsMeasured,
)
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.driving.odometry.models import TOPICS, ResetOdometryParams
from chefbotd.features.feature import Feature, Service
from chefbotd.motion import odometry as dead_reckoning
from chefbotd.motion.fused_odometry import FusedOdometry
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.motion.odometry import (
    COMMAND_SIGMA,
    COMMAND_TIME_CONSTANT_S,
    OdometryParameters,
    OdometrySource,
    OdometryState,
)
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import DONE, Done
from chefbotd.rpc.parameters import Role
from chefbotd.sensing.imu import ImuParameters

log = structlog.get_logger(component="odometry")


class OdometryServiceState(MutableState):
    """The pose, the speeds that the sides have by command with their time, and the condition that was published last."""

    odometry: OdometryState = dead_reckoning.START
    sides_m_s: tuple[float, float] = (0.0, 0.0)
    driven_s: float | None = None
    imu: ImuTrust = ImuTrust.UNUSED
    anomaly: MotionAnomaly = MotionAnomaly.NONE


class OdometryService(StatefulPart[OdometryServiceState]):
    """Owns the pose ``odom_from_base``. ``imu`` is asked only by the source ``wheels_imu``."""

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        chassis: ChassisParameters,
        parameters: OdometryParameters,
        imu: ImuParameters | None = None,
    ) -> None:
        self._bus, self._clock, self._parameters = bus, clock, parameters
        self._kinematics = Kinematics(chassis)
        self.memory = OdometryServiceState()
        self._failure = HandlerFailure()
        self.fused: FusedOdometry | None = None
        match parameters.source:
            case OdometrySource.WHEELS:
                bus.add_handler(self._integrate, WheelsMeasured, on_error=self._failure.report)
            case OdometrySource.COMMANDS:
                # what is commanded is no measurement: its errors do not shrink with a better wheel
                variance = COMMAND_SIGMA**2
                self._parameters = parameters.model_copy(
                    update={
                        "travel_variance_m2_per_m": variance,
                        "turn_variance_rad2_per_rad": variance,
                    }
                )
                bus.add_handler(self._follow_command, WheelsDriven, on_error=self._failure.report)
            case OdometrySource.WHEELS_IMU:
                self.fused = self._fused(chassis, parameters, imu or ImuParameters())

    def _fused(
        self, chassis: ChassisParameters, parameters: OdometryParameters, imu: ImuParameters
    ) -> FusedOdometry:
        bus, on_error = self._bus, self._failure.report
        fused = FusedOdometry(
            parameters.fusion,
            track_width_m=self._kinematics.track_width_m,
            travel_variance=parameters.travel_variance_m2_per_m,
            turn_variance=parameters.turn_variance_rad2_per_rad,
            imu_scale=imu.gyro_scale,
            imu_lag_s=imu.lag_s,
            is_skid_steer=chassis.is_skid_steer,
        )
        bus.add_handler(partial(self._integrate_fused, fused), WheelsMeasured, on_error=on_error)
        bus.add_handler(fused.add_driven, WheelsDriven, on_error=on_error)
        bus.add_handler(fused.add_imu, ImuMeasured, on_error=on_error)
        bus.add_handler(lambda _: fused.forget_imu(), BoardRestarted, LinkClosed, on_error=on_error)
        return fused

    @method(role=Role.DRIVE, moves=False)
    def reset_odometry(self, caller: Caller, params: ResetOdometryParams) -> Done:
        """Set the robot's pose in odom; the default is the origin."""
        self.set_pose(Pose2D(params.x_m, params.y_m, params.heading_rad))
        return DONE

    def set_pose(self, odom_from_base: Pose2D) -> None:
        """Declare the robot's pose; the covariance starts again from zero."""
        now_s, before = self._clock.now_s(), self.memory.odometry.odom_from_base
        self.memory.odometry = dead_reckoning.set_pose(self.memory.odometry, odom_from_base)
        if self.fused is not None:
            self.fused.move_to(self.memory.odometry.odom_from_base)
        self._bus.publish(OdometryReset(now_s, before, self.memory.odometry.odom_from_base))
        self._publish_odometry(now_s, now_s)

    async def run(self) -> None:
        """Raise the error of a reading that could not be integrated; readings are integrated as they are published."""
        await self._failure.wait()

    def _integrate(self, event: WheelsMeasured) -> None:
        left_m, right_m = self._kinematics.side_travel_m(event.travel_rad, event.excluded)
        twist = self._kinematics.twist(event.velocity_rad_s, event.excluded)
        self.memory.odometry = dead_reckoning.integrate(
            self._parameters, self._kinematics.track_width_m, self.memory.odometry, left_m, right_m, twist
        )
        self._publish_odometry(event.stamp_s, event.arrival_s)

    def _follow_command(self, event: WheelsDriven) -> None:
        """Follow the speeds that were commanded up to now; the wheels reach them with a first-order lag."""
        before_s, self.memory.driven_s = self.memory.driven_s, event.stamp_s
        dt_s = 0.0 if before_s is None else max(event.stamp_s - before_s, 0.0)
        left_m, right_m = (speed_m_s * dt_s for speed_m_s in self.memory.sides_m_s)
        share = -math.expm1(-dt_s / COMMAND_TIME_CONSTANT_S)
        target_m_s = self._kinematics.side_travel_m(event.target_rad_s) if any(event.duty) else (0.0, 0.0)
        left_m_s, right_m_s = (
            now + share * (target - now)
            for now, target in zip(self.memory.sides_m_s, target_m_s, strict=True)
        )
        self.memory.sides_m_s = left_m_s, right_m_s
        turn_rad_s = (right_m_s - left_m_s) / self._kinematics.track_width_m
        twist = Twist2D((left_m_s + right_m_s) / 2, turn_rad_s)
        self.memory.odometry = dead_reckoning.integrate(
            self._parameters, self._kinematics.track_width_m, self.memory.odometry, left_m, right_m, twist
        )
        self._publish_odometry(event.stamp_s, event.stamp_s)

    def _integrate_fused(self, fused: FusedOdometry, event: WheelsMeasured) -> None:
        left_m, right_m = self._kinematics.side_travel_m(event.travel_rad, event.excluded)
        estimate = fused.add_travel(event.stamp_s, left_m, right_m)
        twist, rate_rad_s = (
            self._kinematics.twist(event.velocity_rad_s, event.excluded),
            fused.rate_rad_s,
        )
        if rate_rad_s is not None:
            twist = Twist2D(twist.linear_m_s, rate_rad_s)
        self.memory.odometry = OdometryState(estimate.odom_from_base, twist, estimate.pose_covariance)
        imu, anomaly = fused.imu_trust, fused.anomaly
        if imu is not self.memory.imu or anomaly is not self.memory.anomaly:
            if imu is ImuTrust.DISAGREES and self.memory.imu is not imu:
                log.warning("the IMU is left out", reason=fused.imu_reason)
            self.memory.imu, self.memory.anomaly = imu, anomaly
            self._bus.publish(
                OdometryConditionChanged(
                    stamp_s=event.stamp_s, imu=imu, anomaly=anomaly, reason=fused.imu_reason
                )
            )
        self._publish_odometry(event.stamp_s, event.arrival_s)

    def _publish_odometry(self, stamp_s: float, arrival_s: float) -> None:
        state = self.memory.odometry
        self._bus.publish(
            OdometryUpdated(
                stamp_s,
                arrival_s,
                state.odom_from_base,
                state.twist,
                state.covariance,
            )
        )


def odometry(service: OdometryService) -> Feature:
    """The feature for dead reckoning."""
    return Feature(
        "odometry",
        services=(Service("odometry", service.run),),
        methods=methods_of(service),
        topics=TOPICS,
        parts={"odometry": service} | ({} if service.fused is None else {"fusion": service.fused}),
    )
