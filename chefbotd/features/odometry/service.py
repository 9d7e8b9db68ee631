"""Dead reckoning: every measured turn of the wheels becomes an ``OdometryUpdated``."""

from chefbotd.bus import Bus, HandlerFailure
from chefbotd.clock import Clock
from chefbotd.core.events import OdometryReset, OdometryUpdated, WheelsMeasured
from chefbotd.core.geometry import Pose2D
from chefbotd.features.feature import Feature, Service
from chefbotd.features.odometry.models import TOPICS, ResetOdometryParams
from chefbotd.motion import odometry as dead_reckoning
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.motion.odometry import OdometryParameters, OdometryState
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import DONE, Done
from chefbotd.rpc.parameters import Role


class OdometryService:
    """Owns the pose ``odom_from_base``."""

    def __init__(
        self, bus: Bus, clock: Clock, chassis: ChassisParameters, parameters: OdometryParameters
    ) -> None:
        self._bus, self._clock, self._parameters = bus, clock, parameters
        self._kinematics = Kinematics(chassis)
        self._state = dead_reckoning.START
        self._failure = HandlerFailure()
        bus.add_handler(self._integrate, WheelsMeasured, on_error=self._failure.report)

    def state(self) -> OdometryState:
        """The pose."""
        return self._state

    def restore(self, state: OdometryState) -> None:
        """Restore this state."""
        self._state = state

    @method(role=Role.DRIVE, moves=False)
    def reset_odometry(self, caller: Caller, params: ResetOdometryParams) -> Done:
        """Set the robot's pose in odom; the default is the origin."""
        self.set_pose(Pose2D(params.x_m, params.y_m, params.heading_rad))
        return DONE

    def set_pose(self, odom_from_base: Pose2D) -> None:
        """Declare the robot's pose; the covariance starts again from zero."""
        now_s, before = self._clock.now_s(), self._state.odom_from_base
        self._state = dead_reckoning.set_pose(self._state, odom_from_base)
        self._bus.publish(OdometryReset(now_s, before, self._state.odom_from_base))
        self._publish(now_s, now_s)

    async def run(self) -> None:
        """Raise the error of a reading that could not be integrated; readings are integrated as they are published."""
        await self._failure.wait()

    def _integrate(self, event: WheelsMeasured) -> None:
        left_m, right_m = self._kinematics.side_travel_m(event.travel_rad, event.excluded)
        twist = self._kinematics.twist(event.velocity_rad_s, event.excluded)
        self._state = dead_reckoning.integrate(
            self._parameters, self._kinematics.track_width_m, self._state, left_m, right_m, twist
        )
        self._publish(event.stamp_s, event.arrival_s)

    def _publish(self, stamp_s: float, arrival_s: float) -> None:
        state = self._state
        self._bus.publish(
            OdometryUpdated(stamp_s, arrival_s, state.odom_from_base, state.twist, state.covariance)
        )


def odometry(service: OdometryService) -> Feature:
    """The feature for dead reckoning."""
    return Feature(
        "odometry",
        services=(Service("odometry", service.run),),
        methods=methods_of(service),
        topics=TOPICS,
        parts={"odometry": service},
    )
