"""What each method of the socket does.

A handler runs in the call that delivered the request's bytes: a stop reaches the wire in one call stack.
"""

from collections.abc import Iterable

from chefbotd.api import models
from chefbotd.api.describe import describe
from chefbotd.api.fanout import Fanout
from chefbotd.api.jsonrpc import ErrorKind
from chefbotd.api.method import Caller, Method, Unserved
from chefbotd.api.robot import Robot
from chefbotd.api.telemetry import StatsData
from chefbotd.api.topics import link_data, safety_data
from chefbotd.clock import Clock
from chefbotd.core.geometry import Pose2D, Twist2D

DONE = models.Done()


class Methods:
    """The handlers, over one robot and one fan-out; ``table`` names them."""

    def __init__(self, robot: Robot, fanout: Fanout, clock: Clock) -> None:
        self._robot, self._fanout, self._clock = robot, fanout, clock
        nothing, done = models.NoParams, models.Done
        self.table = {
            "describe": Method(nothing, models.Description, self._describe),
            "ping": Method(nothing, models.Pong, self._ping),
            "get_state": Method(nothing, models.State, self._get_state),
            "get_stats": Method(nothing, StatsData, self._get_stats),
            "subscribe": Method(
                models.SubscribeParams, models.Subscribed, self._subscribe, afterwards=self._send_snapshots
            ),
            "unsubscribe": Method(models.UnsubscribeParams, models.Subscribed, self._unsubscribe),
            "drive": Method(models.DriveParams, done, self._drive),
            "stop": Method(nothing, done, self._stop),
            "estop": Method(models.EstopParams, done, self._estop),
            "arm": Method(nothing, done, self._arm),
            "get_pid": Method(nothing, models.Wheels, self._get_pid),
            "set_pid": Method(models.SetPidParams, models.Wheels, self._set_pid),
            "undo_pid": Method(nothing, models.Wheels, self._undo_pid),
            "reset_odometry": Method(models.ResetOdometryParams, done, self._reset_odometry),
            "reset_board": Method(nothing, done, self._reset_board),
        }
        self._description = describe(self.table, fanout.topics)

    def _describe(self, caller: Caller, params: models.NoParams) -> models.Description:
        """Methods, topics and errors, with the JSON Schemas of what they carry."""
        return self._description

    def _ping(self, caller: Caller, params: models.NoParams) -> models.Pong:
        """Answer at once, with the daemon's time."""
        return models.Pong(stamp_s=self._clock.now_s())

    def _get_state(self, caller: Caller, params: models.NoParams) -> models.State:
        """The link, the gate, and the latest value of each topic with its age."""
        return models.State(
            stamp_s=self._clock.now_s(),
            link=link_data(self._fanout.state("link")),
            safety=safety_data(self._fanout.state("safety")),
            topics=self._fanout.states(),
        )

    def _get_stats(self, caller: Caller, params: models.NoParams) -> StatsData:
        """The daemon's counters as they stand."""
        return StatsData.model_validate(self._robot.stats(), from_attributes=True)

    def _subscribe(self, caller: Caller, params: models.SubscribeParams) -> models.Subscribed:
        """Receive topics from now on, the latest value of each first; replaces their rate and policy."""
        self._require_known(params.topics)
        interval_s = 0.0 if params.max_rate_hz is None else 1.0 / params.max_rate_hz
        self._fanout.subscribe(caller, params.topics, params.policy, interval_s)
        return self._subscribed(caller)

    def _send_snapshots(self, caller: Caller, params: models.SubscribeParams) -> None:
        self._fanout.snapshot(caller, dict.fromkeys(params.topics))

    def _unsubscribe(self, caller: Caller, params: models.UnsubscribeParams) -> models.Subscribed:
        """Receive these topics no more; without any, none at all."""
        self._require_known(params.topics or ())
        self._fanout.unsubscribe(caller, params.topics)
        return self._subscribed(caller)

    def _subscribed(self, caller: Caller) -> models.Subscribed:
        return models.Subscribed(topics=self._fanout.subscribed(caller))

    def _require_known(self, names: Iterable[str]) -> None:
        known = self._fanout.topics
        for name in names:
            if name not in known:
                raise Unserved(ErrorKind.UNKNOWN_TOPIC, f"no topic {name!a}; there are {', '.join(known)}")

    def _drive(self, caller: Caller, params: models.DriveParams) -> models.Done:
        """Move so until the command is replaced or too old; repeat it to keep moving."""
        self._robot.drive(params.source, Twist2D(params.linear_m_s, params.angular_rad_s))
        return DONE

    def _stop(self, caller: Caller, params: models.NoParams) -> models.Done:
        """Come to rest within the deceleration limit; the next drive moves again."""
        self._robot.stop()
        return DONE

    def _estop(self, caller: Caller, params: models.EstopParams) -> models.Done:
        """Stop the motors at once, and until armed again."""
        self._robot.estop(params.reason)
        return DONE

    def _arm(self, caller: Caller, params: models.NoParams) -> models.Done:
        """Allow motion, after an emergency stop or a fault."""
        self._robot.arm()
        return DONE

    def _get_pid(self, caller: Caller, params: models.NoParams) -> models.Wheels:
        """The gains of every wheel."""
        return models.Wheels(wheels=dict(self._robot.pid()))

    def _set_pid(self, caller: Caller, params: models.WheelParams) -> models.Wheels:
        """Change some gains of a wheel, or of all, while it runs; what every wheel now has."""
        return models.Wheels(wheels=dict(self._robot.set_pid(params.wheel, params.changes())))

    def _undo_pid(self, caller: Caller, params: models.NoParams) -> models.Wheels:
        """Take the latest change of gains back, whoever made it; what every wheel now has."""
        return models.Wheels(wheels=dict(self._robot.undo_pid()))

    def _reset_odometry(self, caller: Caller, params: models.ResetOdometryParams) -> models.Done:
        """Declare where the robot stands in odom; the origin, if nothing is said."""
        self._robot.set_odometry(Pose2D(params.x_m, params.y_m, params.heading_rad))
        return DONE

    def _reset_board(self, caller: Caller, params: models.NoParams) -> models.Done:
        """Restart the board; its counters begin anew."""
        self._robot.reset_board()
        return DONE
