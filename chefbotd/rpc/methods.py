"""What each method of the socket does.

A handler runs in the call that delivered the request's bytes: a stop reaches the wire in one call stack.
"""

from collections.abc import Iterable

import structlog

from chefbotd.clock import Clock
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.messages import params, results
from chefbotd.messages.roles import Role
from chefbotd.messages.telemetry import StatsData, TopicData
from chefbotd.rpc.access import Keyring
from chefbotd.rpc.arrivals import Arrivals
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.describe import describe
from chefbotd.rpc.fanout import Fanout
from chefbotd.rpc.jsonrpc import ErrorKind
from chefbotd.rpc.lenient import EstopParams, StopParams
from chefbotd.rpc.method import Caller, Method, Unserved
from chefbotd.rpc.robot import Robot
from chefbotd.rpc.session import Session
from chefbotd.rpc.topics import link_data, safety_data

log = structlog.get_logger(__name__)

DONE = results.Done()


class Methods:
    """The handlers, over one robot and one fan-out; ``table`` names them."""

    def __init__(
        self,
        robot: Robot,
        fanout: Fanout,
        clock: Clock,
        control: ControlLeases,
        arrivals: Arrivals,
        keyring: Keyring | None = None,
        arm_role: Role = Role.DRIVE,
    ) -> None:
        self._robot, self._fanout, self._clock = robot, fanout, clock
        self._control, self._arrivals, self._keyring = control, arrivals, keyring
        nothing, done, stopped = params.NoParams, results.Done, results.Stopped
        observe, drive, admin = Role
        self.table = {
            "authenticate": Method(
                None, params.AuthenticateParams, results.Known, self._authenticate, when_crowded=True
            ),
            "set_client_name": Method(
                observe, params.SetClientNameParams, done, self._set_client_name, when_crowded=True
            ),
            "describe": Method(observe, nothing, results.Description, self._describe, constant=True),
            "get_description": Method(observe, nothing, results.RobotDescription, self._get_description),
            "ping": Method(observe, nothing, results.Pong, self._ping),
            "get_state": Method(observe, nothing, results.State, self._get_state),
            "get_stats": Method(observe, nothing, StatsData, self._get_stats),
            "subscribe": Method(
                observe, params.SubscribeParams, results.Subscribed, self._subscribe, self._send_snapshots
            ),
            "unsubscribe": Method(observe, params.UnsubscribeParams, results.Subscribed, self._unsubscribe),
            "drive": Method(drive, params.DriveParams, results.Driven, self._drive, moves=True),
            "set_wheel_velocities": Method(
                drive,
                params.SetWheelVelocitiesParams,
                results.WheelsDriven,
                self._set_wheel_velocities,
                moves=True,
            ),
            "take_control": Method(drive, params.TakeControlParams, results.Taken, self._take_control),
            "release_control": Method(drive, nothing, results.Released, self._release_control),
            "stop": Method(observe, StopParams, stopped, self._stop, urgent=True, when_crowded=True),
            "estop": Method(observe, EstopParams, stopped, self._estop, urgent=True, when_crowded=True),
            "arm": Method(arm_role, nothing, done, self._arm, moves=True),
            "get_pid": Method(observe, nothing, results.Wheels, self._get_pid),
            "set_pid": Method(admin, params.SetPidParams, results.Wheels, self._set_pid),
            "undo_pid": Method(admin, nothing, results.Wheels, self._undo_pid),
            "reset_odometry": Method(drive, params.ResetOdometryParams, done, self._reset_odometry),
            "reset_board": Method(admin, nothing, done, self._reset_board),
        }

    def _authenticate(self, caller: Caller, params: params.AuthenticateParams) -> results.Known:
        """Show a token; the role that it gives decides what else may be asked."""
        session, keyring = caller.session, self._keyring
        role = session.role if keyring is None else keyring.role_of(params.token.get_secret_value())
        if role is None:
            raise Unserved(ErrorKind.WRONG_TOKEN, "this token opens nothing here")
        session.role = role
        log.info("client_authenticated", client=str(session), role=str(role))
        return results.Known(client=str(session), role=role)

    def _set_client_name(self, caller: Caller, params: params.SetClientNameParams) -> results.Done:
        """Say what this client is called where others see who drives."""
        caller.session.client = params.client
        self._control.renamed(caller.session, self._clock.now_s())
        return DONE

    def _describe(self, caller: Caller, params: params.NoParams) -> results.Description:
        """Methods, topics and errors, with the JSON Schemas of what they carry."""
        return describe(self.table, self._fanout.topics)

    def _get_description(self, caller: Caller, params: params.NoParams) -> results.RobotDescription:
        """The robot's own description: its links and joints."""
        return results.RobotDescription(urdf=self._robot.description)

    def _ping(self, caller: Caller, params: params.NoParams) -> results.Pong:
        """Answer at once, with the daemon's time."""
        return results.Pong(stamp_s=self._clock.now_s())

    def _get_state(self, caller: Caller, params: params.NoParams) -> results.State:
        """The link, the gate, and the latest value of each topic with its age."""
        return results.State(
            stamp_s=self._clock.now_s(),
            link=link_data(self._fanout.state("link")),
            safety=safety_data(self._fanout.state("safety")),
            topics=self._fanout.states(),
        )

    def _get_stats(self, caller: Caller, params: params.NoParams) -> TopicData:
        """The daemon's counters as they stand."""
        return StatsData.model_validate(self._robot.stats(), from_attributes=True)

    def _subscribe(self, caller: Caller, params: params.SubscribeParams) -> results.Subscribed:
        """Receive topics from now on, the latest value of each first; replaces their rate and policy."""
        self._require_known(params.topics)
        interval_s = 0.0 if params.max_rate_hz is None else 1.0 / params.max_rate_hz
        self._fanout.subscribe(caller, params.topics, params.policy, interval_s)
        return self._subscribed(caller)

    def _send_snapshots(self, caller: Caller, params: params.SubscribeParams) -> None:
        self._fanout.snapshot(caller, dict.fromkeys(params.topics))

    def _unsubscribe(self, caller: Caller, params: params.UnsubscribeParams) -> results.Subscribed:
        """Receive these topics no more; without any, none at all."""
        self._require_known(params.topics or ())
        self._fanout.unsubscribe(caller, params.topics)
        return self._subscribed(caller)

    def _subscribed(self, caller: Caller) -> results.Subscribed:
        return results.Subscribed(topics=self._fanout.subscribed(caller))

    def _require_known(self, names: Iterable[str]) -> None:
        known = self._fanout.topics
        for name in names:
            if name not in known:
                raise Unserved(ErrorKind.UNKNOWN_TOPIC, f"no topic {name!a}; there are {', '.join(known)}")

    def _drive(self, caller: Caller, params: params.DriveParams) -> results.Driven:
        """Move so until the command is replaced or too old; repeat it to keep moving."""
        now_s, source = self._clock.now_s(), params.source or self._robot.default_source
        self._require_control(source, caller.session, now_s)
        allowed = self._robot.drive(source, Twist2D(params.linear_m_s, params.angular_rad_s))
        self._control.renew(source, caller.session, now_s)
        twist = allowed.command
        return results.Driven(
            linear_m_s=twist.linear_m_s, angular_rad_s=twist.angular_rad_s, limited_by=allowed.limited_by
        )

    def _require_control(self, source: str, session: Session, now_s: float) -> None:
        if source in self._robot.sources:  # the robot refuses any other
            self._control.require(source, session, now_s)

    def _set_wheel_velocities(
        self, caller: Caller, params: params.SetWheelVelocitiesParams
    ) -> results.WheelsDriven:
        """Turn each wheel so, as ``drive`` moves the whole robot; wheels that are not named stand."""
        now_s, source = self._clock.now_s(), params.source or self._robot.default_source
        self._require_control(source, caller.session, now_s)
        allowed = self._robot.set_wheel_velocities(source, params.by_name())
        self._control.renew(source, caller.session, now_s)
        speeds = [allowed.command[name] for name in params.name]
        return results.WheelsDriven(name=params.name, velocity_rad_s=speeds, limited_by=allowed.limited_by)

    def _take_control(self, caller: Caller, params: params.TakeControlParams) -> results.Taken:
        """Have a source of commands for oneself, whoever has it now; who had it comes to rest."""
        source, known = params.source or self._robot.default_source, self._robot.sources
        if source not in known:
            raise Refused(
                RefusalKind.UNKNOWN_SOURCE, f"no source named {source!a}; there are {', '.join(known)}"
            )
        before = self._control.take(source, caller.session, self._clock.now_s())
        others = None if before is None or before is caller.session else str(before)
        if others is not None:
            self._robot.resume((source,))
        return results.Taken(source=source, taken_from=others)

    def _release_control(self, caller: Caller, params: params.NoParams) -> results.Released:
        """Give back every source that this client has; its commands are withdrawn."""
        return results.Released(sources=self._control.release(caller.session, self._clock.now_s()))

    def _stop(self, caller: Caller, params: StopParams) -> results.Stopped:
        """Come to rest within the deceleration limit; sources that others drive are held until they let go."""
        now_s = self._clock.now_s()
        drivers = self._control.drivers(now_s)
        try:
            self._robot.stop(str(caller.session), self._control.tried(caller.session))
        finally:
            self._arrivals.record_stop(caller, str(caller.session))
        return results.Stopped(drivers=drivers)

    def _estop(self, caller: Caller, params: EstopParams) -> results.Stopped:
        """Stop the motors at once, and until armed again."""
        drivers = self._control.drivers(self._clock.now_s())
        try:
            self._robot.estop(params.reason)
        finally:
            self._arrivals.record_stop(caller, str(caller.session))
        return results.Stopped(drivers=drivers)

    def _arm(self, caller: Caller, params: params.NoParams) -> results.Done:
        """Allow motion, after an emergency stop or a fault."""
        self._robot.arm()
        self._robot.resume(self._control.tried(caller.session))
        return DONE

    def _get_pid(self, caller: Caller, params: params.NoParams) -> results.Wheels:
        """The gains of every wheel."""
        return results.Wheels(wheels=dict(self._robot.pid()))

    def _set_pid(self, caller: Caller, params: params.WheelParams) -> results.Wheels:
        """Change some gains of a wheel, or of all, while it runs; what every wheel now has."""
        return results.Wheels(wheels=dict(self._robot.set_pid(params.wheel, params.changes())))

    def _undo_pid(self, caller: Caller, params: params.NoParams) -> results.Wheels:
        """Take the latest change of gains back, whoever made it; what every wheel now has."""
        return results.Wheels(wheels=dict(self._robot.undo_pid()))

    def _reset_odometry(self, caller: Caller, params: params.ResetOdometryParams) -> results.Done:
        """Declare where the robot stands in odom; the origin, if nothing is said."""
        self._robot.set_odometry(Pose2D(params.x_m, params.y_m, params.heading_rad))
        return DONE

    def _reset_board(self, caller: Caller, params: params.NoParams) -> results.Done:
        """Restart the board; its counters begin anew."""
        self._robot.reset_board()
        return DONE
