"""A robot behind the command socket that remembers what it was asked, and refuses on demand."""

import math
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

from chefbotd.bus import Bus
from chefbotd.clock import Clock, ManualClock
from chefbotd.core.commands import Allowed, RefusalKind, Refused
from chefbotd.core.events import ControlChanged, StatsSampled
from chefbotd.core.geometry import Pose2D, Twist2D
from chefbotd.core.record import replace
from chefbotd.features.board.methods import TOPICS as BOARD
from chefbotd.features.board.methods import BoardMethods
from chefbotd.features.depth_cameras.feature import topic as depth_cameras_topic
from chefbotd.features.description.feature import description
from chefbotd.features.driving.methods import DrivingMethods
from chefbotd.features.driving.methods import methods as driving_methods
from chefbotd.features.driving.methods import topics as driving_topics
from chefbotd.features.feature import Feature, methods_and_topics
from chefbotd.features.lidars.feature import topics as lidar_topics
from chefbotd.features.localization.methods import TOPICS as LOCALIZATION
from chefbotd.features.localization.methods import LocalizationMethods, LocalizationResult
from chefbotd.features.mapping.methods import TOPICS as MAPPING
from chefbotd.features.mapping.methods import MappingMethods, MappingResult, MapSaved
from chefbotd.features.maps.feature import maps
from chefbotd.features.maps.service import MapsService
from chefbotd.features.navigation.methods import TOPICS as NAVIGATION
from chefbotd.features.navigation.methods import (
    GoalResult,
    NavigationMethods,
    PlanResult,
    Waypoint,
    shown_topics,
)
from chefbotd.features.odometry.methods import TOPICS as ODOMETRY
from chefbotd.features.odometry.methods import OdometryMethods
from chefbotd.features.recording.methods import TOPICS as RECORDING
from chefbotd.features.recording.methods import (
    RecordedFile,
    RecordingEnded,
    RecordingList,
    RecordingMethods,
    RecordingStarted,
    RingSaved,
)
from chefbotd.features.sensors.methods import TOPICS as SENSORS
from chefbotd.features.simulation.feature import SIMULATION
from chefbotd.features.statistics.feature import statistics_without_service
from chefbotd.features.tuning.methods import TuningMethods
from chefbotd.features.worker.methods import TOPICS as WORKER
from chefbotd.maps.store import MapStore
from chefbotd.metrics import Metrics
from chefbotd.motion.pid import PidParameters
from chefbotd.navigation.section import NavigationSection
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.fanout import Fanout
from chefbotd.rpc.jobs import Progress
from chefbotd.rpc.method import Method, methods_of
from chefbotd.rpc.methods import method_table
from chefbotd.rpc.roles import Role
from chefbotd.rpc.topics import Topic
from chefbotd.sensing.lidar import LidarModel, LidarParameters

WHEELS = ("left", "right")
NO_FOLDER = Path("/nonexistent/maps")

LIDAR = LidarParameters(name="top", model=LidarModel.LD19, device="/dev/ttyUSB0")

STATS = StatsSampled(
    stamp_s=1.0,
    figures={"uptime_s": 60.0, "frames": {"encoders": 100}, "lines_out": 50, "board_clock_skew_ppm": None},
)

MAPPING_RESULT = MappingResult(state="mapping", name=None, keyframes=40, loops=2, path_m=12.5)


class FakeLocalizer:
    """Remembers with the robot's other calls what it was told."""

    def __init__(self, robot: "FakeRobot") -> None:
        self._robot = robot

    async def set_pose(self, x_m: float, y_m: float, heading_rad: float) -> LocalizationResult:
        """Remember it."""
        self._robot.calls.append(("set_pose", x_m, y_m, heading_rad))
        return LocalizationResult(state="uncertain", map="flat")

    async def localize(self, progress: Progress, *, turn: bool) -> LocalizationResult:
        """Remember it."""
        self._robot.calls.append(("localize", turn))
        told = "it has turned once" if turn else ""
        return LocalizationResult(state="searching", map="flat", reason=told)


class FakeNavigation:
    """Remembers with the robot's other calls what it was told; every goal is reached."""

    def __init__(self, robot: "FakeRobot") -> None:
        self._robot = robot
        self._count = 0

    async def navigate_to(self, waypoints: list[Waypoint], *, queue: bool) -> list[int]:
        """Remember it."""
        goals = [each.model_dump(exclude_defaults=True) for each in waypoints]
        self._robot.calls.append(("navigate_to", goals, queue))
        self._count += len(waypoints)
        return list(range(self._count - len(waypoints) + 1, self._count + 1))

    async def wait(self, goals: list[int], progress: Progress) -> GoalResult:
        """It is there at once."""
        return GoalResult(goal=goals[-1], end="reached", reason="reached (1.00, 2.00)")

    async def plan_to(self, waypoint: Waypoint) -> PlanResult:
        """Remember it."""
        self._robot.calls.append(("plan_to", waypoint.model_dump(exclude_defaults=True)))
        return PlanResult(possible=True, length_m=3.4, time_s=14.0, x_m=(0.0, 1.0), y_m=(0.0, 2.0))

    def cancel(self, reason: str) -> None:
        """Remember it."""
        self._robot.calls.append(("cancel_navigation",))

    def pause(self, by: str) -> None:
        """Remember it."""
        self._robot.calls.append(("pause_navigation",))

    def resume(self) -> None:
        """Remember it."""
        self._robot.calls.append(("resume_navigation",))


class FakeRecorder:
    """Remembers with the robot's other calls what it was told."""

    def __init__(self, robot: "FakeRobot") -> None:
        self._robot = robot

    async def start(self, name: str | None) -> RecordingStarted:
        """Remember it."""
        self._robot.calls.append(("start_recording", name))
        return RecordingStarted(name=f"{name}_1", file=f"/recordings/{name}_1.mcap")

    async def stop(self) -> RecordingEnded:
        """Remember it."""
        self._robot.calls.append(("stop_recording",))
        return RecordingEnded(
            name="a_1", file="/recordings/a_1.mcap", seconds=12.5, size_bytes=4_000, messages=321, dropped=0
        )

    async def list_recordings(self) -> RecordingList:
        """One file, which was cut."""
        row = RecordedFile(
            file="a_1.mcap", size_bytes=4_000, changed_at_s=1.7e9, complete=False, recording=False
        )
        return RecordingList(folder="/recordings", files=(row,))

    async def save_ring(self, reason: str) -> RingSaved:
        """Remember it."""
        self._robot.calls.append(("save_ring", reason))
        return RingSaved(file=f"/recordings/ring_{reason}_1.mcap", seconds=118.0)


class FakeRobot:
    """``calls`` lists every command; ``answer`` is raised by every one of them, if set."""

    command_timeout_s = 0.5
    stop_hold_s = 1.0
    link_is_up = False
    arm_role = Role.DRIVE
    default_source = "teleop"
    description: str | None = "<robot name='fake'/>"
    sources = ("safety", "teleop", "navigation")

    def __init__(self) -> None:
        self.calls: list[tuple[object, ...]] = []
        self.resumed: list[str] = []
        self.answer: Exception | None = None
        self.wheels = {name: PidParameters(kp=400.0, ki=100.0, output_limit=1023.0) for name in WHEELS}

    def _record(self, *call: object) -> None:
        if self.answer is not None:
            raise self.answer
        self.calls.append(call)

    def drive(self, source: str, twist: Twist2D) -> Allowed[Twist2D]:
        """Remember it; it goes 1 m/s at most."""
        self._record("drive", source, twist)
        if abs(twist.linear_m_s) <= 1.0:
            return Allowed(twist)
        return Allowed(Twist2D(math.copysign(1.0, twist.linear_m_s), twist.angular_rad_s), "limits.linear")

    def set_wheel_velocities(
        self, source: str, velocity_rad_s: Mapping[str, float]
    ) -> Allowed[Mapping[str, float]]:
        """Remember it; only the two wheels of ``WHEELS`` are known, and they turn at 10 rad/s at most."""
        self._record("set_wheel_velocities", source, dict(velocity_rad_s))
        for wheel in velocity_rad_s:
            if wheel not in WHEELS:
                raise Refused(RefusalKind.UNKNOWN_WHEEL, f"no wheel {wheel}")
        fastest = max(map(abs, velocity_rad_s.values()))
        share = 1.0 if fastest <= 10.0 else 10.0 / fastest
        slowed = {name: velocity_rad_s.get(name, 0.0) * share for name in WHEELS}
        return Allowed(slowed, None if share == 1.0 else "drive.max_rim_speed_m_s")

    def release(self, source: str) -> None:
        """Remember it."""
        self._record("release", source)

    def stop(self, by: str, excluded: Collection[str] = ()) -> None:
        """Remember it."""
        self._record("stop")

    def resume(self, sources: Collection[str]) -> None:
        """Remember whose driver asks anew, apart from the commands."""
        self.resumed.extend(sources)

    def estop(self, reason: str) -> None:
        """Remember it."""
        self._record("estop", reason)

    def arm(self, latch: int | None = None) -> None:
        """Remember it."""
        self._record("arm", *(() if latch is None else (latch,)))

    def gains(self) -> Mapping[str, PidParameters]:
        """The gains as last set."""
        self._record("pid")
        return self.wheels

    def change(self, wheel: str, changes: Mapping[str, object]) -> Mapping[str, PidParameters]:
        """Change them; only the two wheels of ``WHEELS`` are known."""
        self._record("set_pid", wheel, dict(changes))
        if wheel not in (*WHEELS, "all"):
            raise Refused(RefusalKind.UNKNOWN_WHEEL, f"no wheel {wheel}")
        for name in WHEELS:
            if wheel in (name, "all"):
                self.wheels[name] = self.wheels[name].model_copy(update=changes)
        return self.wheels

    def undo(self) -> Mapping[str, PidParameters]:
        """Remember it; the gains as last set."""
        self._record("undo_pid")
        return self.wheels

    def set_pose(self, pose: Pose2D) -> None:
        """Remember it."""
        self._record("set_odometry", pose)

    def reset_board(self) -> None:
        """Remember it."""
        self._record("reset_board")

    async def start(self, name: str | None, *, unfinished: bool) -> MappingResult:
        """Remember it."""
        self._record("start_mapping", name, unfinished)
        return MAPPING_RESULT

    async def pause(self) -> MappingResult:
        """Remember it."""
        self._record("pause_mapping")
        return MAPPING_RESULT.model_copy(update={"state": "paused"})

    async def finish(self, name: str, progress: Progress) -> MapSaved:
        """Remember it, and be half done on the way."""
        self._record("finish_mapping", name)
        progress.report(1, 2, "matching")
        return MapSaved(name=name, version=3, keyframes=40, loops=2, path_m=12.5)

    async def discard(self) -> MappingResult:
        """Remember it."""
        self._record("discard_mapping")
        return MAPPING_RESULT.model_copy(update={"state": "idle"})

    def sample(self) -> StatsSampled:
        """The same ones always, but for a count of commands."""
        self._record("stats")
        return replace(STATS, figures={**STATS.figures, "control_steps": len(self.calls)})

    def features(self, leases: ControlLeases, clock: Clock, *, simulated: bool = False) -> list[Feature]:
        """The methods and topics of every feature, over this robot; a simulated one has a lidar as well."""
        driving = DrivingMethods(
            self, leases, clock, sources=self.sources, default_source=self.default_source
        )
        return [
            Feature(
                "driving", methods=driving_methods(driving, self.arm_role), topics=driving_topics(WHEELS)
            ),
            Feature("odometry", methods=methods_of(OdometryMethods(self)), topics=ODOMETRY),
            Feature("tuning", methods=methods_of(TuningMethods(self))),
            Feature("sensors", topics=SENSORS),
            statistics_without_service(self, Metrics()),
            description(self.description),
            maps(MapsService(Bus(), clock, MapStore(NO_FOLDER), 1)),
            *(
                [SIMULATION, Feature("scans", topics=(*lidar_topics([LIDAR]), depth_cameras_topic()))]
                if simulated
                else []
            ),
            Feature("worker", topics=WORKER),
            Feature(
                "localization",
                methods=methods_of(LocalizationMethods(FakeLocalizer(self))),
                topics=LOCALIZATION,
            ),
            Feature(
                "navigation",
                methods=methods_of(NavigationMethods(FakeNavigation(self), NavigationSection())),
                topics=(*NAVIGATION, *shown_topics()),
            ),
            Feature("recording", methods=methods_of(RecordingMethods(FakeRecorder(self))), topics=RECORDING),
            Feature("mapping", methods=methods_of(MappingMethods(self)), topics=MAPPING),
            Feature("board", methods=methods_of(BoardMethods(self)), topics=BOARD),
        ]

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
        sources=robot.sources,
        default_source=robot.default_source,
        resume=robot.resume,
    )


def topics_of(*, simulated: bool) -> dict[str, Topic]:
    """Every topic of a socket in front of a fake robot."""
    robot, clock = FakeRobot(), ManualClock()
    leases = robot.leases(lambda _: None)
    return methods_and_topics(robot.features(leases, clock, simulated=simulated))[1]
