"""A robot behind the command socket that remembers what it was asked, and refuses on demand."""

import math
from collections.abc import Callable, Mapping
from functools import cache, partial, wraps
from inspect import iscoroutinefunction
from typing import Any

from chefbotd.clock import Clock, ManualClock
from chefbotd.components.navigation.commands import NavigationCommands
from chefbotd.components.navigation.events import GoalCause, GoalReport, GoalResult, PlanResult
from chefbotd.components.navigation.models import GoalParams, Waypoint
from chefbotd.components.navigation.parameters import NavigationSection
from chefbotd.components.statistics.models import StatsData, stats_data
from chefbotd.components.tuning.models import WheelParams, Wheels
from chefbotd.core.commands import Allowed, RefusalKind, Refused
from chefbotd.core.events import ControlChanged, StatsSampled
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import replace
from chefbotd.driving.commands import DriveCommands
from chefbotd.driving.commands import methods as driving_methods
from chefbotd.driving.description.models import RobotDescription
from chefbotd.driving.odometry.models import ResetOdometryParams
from chefbotd.features.feature import Feature, methods_and_topics
from chefbotd.motion.pid import PidParameters
from chefbotd.process.build import build
from chefbotd.rpc.control_leases import ControlLeases, Sources
from chefbotd.rpc.encoding import Sent
from chefbotd.rpc.fanout import Fanout
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, Method, method, methods_of
from chefbotd.rpc.methods import method_table
from chefbotd.rpc.models import DONE, Done, NoParams, Params
from chefbotd.rpc.parameters import Role
from chefbotd.rpc.session import Session
from chefbotd.rpc.topics import Topic
from chefbotd.settings import load, packaged
from chefbotd.testing.recording import write_inline
from tests.fakes.example import example

WHEELS = ("left", "right")
SIMULATED = ("simulation", "lidars", "depth_cameras")
"""Features of which most tests want to see nothing."""

BY_HAND = frozenset(
    (
        *("drive", "set_wheel_velocities", "stop", "estop", "arm", "reset_odometry", "reset_board"),
        *("get_pid", "set_pid", "undo_pid", "get_stats", "get_description"),
        *("navigate_to", "follow_waypoints", "go_home", "dock", "plan_to", "get_goal"),
        *("cancel_navigation", "pause_navigation", "resume_navigation"),
    )
)
"""What the robots here carry out. All other methods are remembered, and answered with an example."""

STATS = StatsSampled(
    stamp_s=1.0,
    figures={"uptime_s": 60.0, "frames": {"encoders": 100}, "lines_out": 50, "board_clock_skew_ppm": None},
)


@cache
def real_features() -> tuple[Feature, ...]:
    """Those of a simulated robot that has all there is, from a real daemon, which does not run."""
    camera = {"name": "camera", "mount_x_m": 0.1, "mount_height_m": 0.4}
    told = {"enabled": True, "ntfy_url": "https://ntfy.example/topic"}
    more = {"invitations": {"enabled": True}, "notifications": told, "camera": {"enabled": True}}
    overrides = {"depth_camera": [camera], **more}
    settings = load(packaged("chefbot_lidar"), overrides=overrides)
    daemon = build(settings, clock=ManualClock(), simulated=True, substitutes={"recording": write_inline})
    return tuple(daemon.features)


class FakeNavigation:
    """Remembers with the robot's other calls what it was told; every goal is reached."""

    def __init__(self, robot: "FakeRobot", section: NavigationSection) -> None:
        self._robot, self.section = robot, section
        self._count, self.waits = 0, self

    async def navigate_to(self, waypoints: list[Waypoint], params: GoalParams, session: Session) -> list[int]:
        """Remember it."""
        goals = [each.model_dump(exclude_defaults=True) for each in waypoints]
        self._robot.calls.append(("navigate_to", goals, params.queue))
        self._count += len(waypoints)
        return list(range(self._count - len(waypoints) + 1, self._count + 1))

    async def wait(self, goals: list[int], progress: ProgressReporter, client: int) -> GoalResult:
        """It is there at once."""
        return GoalResult(goal=goals[-1], end="reached", reason="reached (1.00, 2.00)")

    def result(self, goals: list[int]) -> GoalResult:
        """It was accepted."""
        return GoalResult(goal=goals[-1])

    def report(self, number: int | None, goal_id: str | None) -> GoalReport:
        """Remember it."""
        self._robot.calls.append(("get_goal", goal_id or number))
        return GoalReport(goal=number or 1, end="reached", goal_id=goal_id)

    async def plan_to(self, waypoint: Waypoint) -> PlanResult:
        """Remember it."""
        self._robot.calls.append(("plan_to", waypoint.model_dump(exclude_defaults=True)))
        return PlanResult(possible=True, length_m=3.4, time_s=14.0, x_m=(0.0, 1.0), y_m=(0.0, 2.0))

    def cancel(self, reason: str, cause: GoalCause, by: str) -> None:
        """Remember it."""
        self._robot.calls.append(("cancel_navigation",))

    def pause(self, by: str) -> None:
        """Remember it."""
        self._robot.calls.append(("pause_navigation",))

    def resume(self) -> None:
        """Remember it."""
        self._robot.calls.append(("resume_navigation",))


class FakeRobot:
    """``calls`` lists every command; ``answer`` is raised by every one of them, if set."""

    command_timeout_s = 0.5
    stop_hold_s = 1.0
    stop_number = 0
    link_is_up = False
    arm_role = Role.DRIVE
    default_source = "teleop"
    description: str | None = "<robot name='fake'/>"
    sources = ("safety", "teleop", "navigation")

    def __init__(self) -> None:
        self.calls: list[tuple[object, ...]] = []
        self.acknowledged: list[tuple[int, str | None]] = []
        self.answer: Exception | None = None
        self.pid = {name: PidParameters(kp=400.0, ki=100.0, output_limit=1023.0) for name in WHEELS}

    def _record(self, *call: object) -> None:
        if self.answer is not None:
            raise self.answer
        self.calls.append(call)

    @property
    def wheels(self) -> "FakeRobot":
        """What knows the wheels."""
        return self

    def wheel_velocities(self, velocity_rad_s: Mapping[str, float]) -> dict[str, float]:
        """Only the two wheels of ``WHEELS`` are known."""
        for wheel in velocity_rad_s:
            if wheel not in WHEELS:
                raise Refused(RefusalKind.UNKNOWN_WHEEL, f"no wheel {wheel}")
        return dict(velocity_rad_s)

    def command(self, source: str, motion: Twist2D | Mapping[str, float], client: int) -> None:
        """Remember it."""
        self._record("drive" if isinstance(motion, Twist2D) else "set_wheel_velocities", source, motion)

    def of_twist(self, twist: Twist2D) -> Allowed[Twist2D]:
        """It goes 1 m/s at most."""
        if abs(twist.linear_m_s) <= 1.0:
            return Allowed(twist)
        return Allowed(Twist2D(math.copysign(1.0, twist.linear_m_s), twist.angular_rad_s), "limits.linear")

    def of_wheels(self, velocity_rad_s: Mapping[str, float]) -> Allowed[Mapping[str, float]]:
        """They turn at 10 rad/s at most."""
        fastest = max(map(abs, velocity_rad_s.values()))
        share = 1.0 if fastest <= 10.0 else 10.0 / fastest
        slowed = {name: velocity_rad_s.get(name, 0.0) * share for name in WHEELS}
        return Allowed(slowed, None if share == 1.0 else "drive.max_rim_speed_m_s")

    def release(self, source: str) -> None:
        """Remember it."""
        self._record("release", source)

    def record_attempt(self, source: str, client: int) -> None:
        """Nothing: this robot holds nobody."""

    def stop(self, by: str, client: int) -> None:
        """Remember it."""
        self._record("stop")

    def take_over(self, client: int, source: str, *, from_another: bool) -> None:
        """Remember who takes over, apart from the commands."""
        if from_another:
            self.acknowledged.append((client, source))

    def acknowledge_stops(self, client: int, source: str | None = None) -> None:
        """Remember who asks anew, apart from the commands."""
        self.acknowledged.append((client, source))

    def estop(self, reason: str) -> None:
        """Remember it."""
        self._record("estop", reason)

    def arm(self, latch: int | None = None) -> None:
        """Remember it."""
        self._record("arm", *(() if latch is None else (latch,)))

    @method(role=Role.OBSERVE)
    def get_pid(self, caller: Caller, params: NoParams) -> Wheels:
        """The gains as last set."""
        self._record("pid")
        return Wheels(wheels=dict(self.pid))

    @method(role=Role.ADMIN, moves=False)
    def set_pid(self, caller: Caller, params: WheelParams) -> Wheels:
        """Change them; only the two wheels of ``WHEELS`` are known."""
        wheel, changes = params.wheel, params.changes()
        self._record("set_pid", wheel, changes)
        if wheel not in (*WHEELS, "all"):
            raise Refused(RefusalKind.UNKNOWN_WHEEL, f"no wheel {wheel}")
        for name in WHEELS:
            if wheel in (name, "all"):
                self.pid[name] = self.pid[name].model_copy(update=changes)
        return Wheels(wheels=dict(self.pid))

    @method(role=Role.ADMIN, moves=False)
    def undo_pid(self, caller: Caller, params: NoParams) -> Wheels:
        """Remember it; the gains as last set."""
        self._record("undo_pid")
        return Wheels(wheels=dict(self.pid))

    @method(role=Role.DRIVE, moves=False)
    def reset_odometry(self, caller: Caller, params: ResetOdometryParams) -> Done:
        """Remember it."""
        self._record("set_odometry", Pose2D(params.x_m, params.y_m, params.heading_rad))
        return DONE

    @method(role=Role.ADMIN, moves=False)
    def reset_board(self, caller: Caller, params: NoParams) -> Done:
        """Remember it."""
        self._record("reset_board")
        return DONE

    @method(role=Role.OBSERVE)
    def get_stats(self, caller: Caller, params: NoParams) -> StatsData:
        """The same ones always, but for a count of commands."""
        self._record("stats")
        return stats_data(replace(STATS, figures={**STATS.figures, "control_steps": len(self.calls)}))

    @method(role=Role.OBSERVE)
    def get_description(self, caller: Caller, params: NoParams) -> RobotDescription:
        """The same one always."""
        return RobotDescription(urdf=self.description)

    def features(self, leases: ControlLeases, clock: Clock, *, simulated: bool = False) -> list[Feature]:
        """The real features' methods and topics, over this robot; a simulated one has lidars and the truth as well.

        ``calls`` has those that it does not carry out by their names and parameters.
        """
        robot: Any = self
        driving = DriveCommands(
            robot, robot, leases, clock, sources=self.sources, default_source=self.default_source
        )
        navigation: Any = FakeNavigation(self, NavigationSection())
        own = [
            *driving_methods(driving, self.arm_role),
            *methods_of(NavigationCommands(navigation)),
        ]
        by_name = {each.name: each for each in (*own, *methods_of(self)) if each.name in BY_HAND}
        return [
            Feature(
                feature.name,
                methods=tuple(self._faked(each, by_name.get(each.name)) for each in feature.methods),
                topics=tuple(replace(topic, demanded=None) for topic in feature.topics),
            )
            for feature in real_features()
            if simulated or feature.name not in SIMULATED
        ]

    def _faked(self, method: Method, own: Method | None) -> Method:
        if own is not None:
            handle = (
                own.handle if iscoroutinefunction(own.handle) else wraps(method.handle)(partial(own.handle))
            )
            return replace(method, handle=handle, role=own.role, renew=None)

        @wraps(method.handle)
        def remember(caller: Caller, params: Params) -> Sent:
            self._record(method.name, params.model_dump(mode="json", exclude_unset=True))
            return example(method.result)

        @wraps(method.handle)
        async def remember_in_a_job(caller: Caller, params: Params, progress: ProgressReporter) -> Sent:
            return remember(caller, params)

        return replace(method, handle=remember_in_a_job if iscoroutinefunction(method.handle) else remember)

    def leases(self, announce: Callable[[ControlChanged], None]) -> ControlLeases:
        """Leases on this robot's sources, with the packaged times."""
        return ControlLeases(3.0, self.stop_hold_s, self.release, announce)


def table_of(robot: FakeRobot, fanout: Fanout, clock: Clock, leases: ControlLeases) -> dict[str, Method]:
    """Every method of a socket in front of this robot."""
    methods, _ = methods_and_topics(robot.features(leases, clock))
    return method_table(
        methods,
        fanout,
        clock,
        leases,
        Sources(robot.sources, robot.default_source, robot.take_over),
    )


def topics_of(*, simulated: bool) -> dict[str, Topic]:
    """Every topic of a socket in front of a fake robot."""
    robot, clock = FakeRobot(), ManualClock()
    leases = robot.leases(lambda _: None)
    return methods_and_topics(robot.features(leases, clock, simulated=simulated))[1]


def methods_of_socket() -> dict[str, Method]:
    """Every method of a socket in front of a fake robot."""
    robot, clock = FakeRobot(), ManualClock()
    fanout = Fanout(topics_of(simulated=True), clock, lambda *_: None)
    return table_of(robot, fanout, clock, robot.leases(lambda _: None))
