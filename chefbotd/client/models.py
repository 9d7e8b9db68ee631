# Written by `make client`: see tests/chefbotd/client/generate.py. Whatever is changed here by hand is lost.
# fmt: off
"""Every model that a client reads: the results of the methods, and the data of the topics."""

from collections.abc import Mapping

from chefbotd.components.agents.events import (
    AgentData as AgentData, AgentEventData as AgentEventData, AgentMessageData as AgentMessageData,
    AgentsData as AgentsData, ButtonData as ButtonData, QuestionData as QuestionData
)
from chefbotd.components.agents.models import (
    AskResult as AskResult, ButtonAdded as ButtonAdded, CallResult as CallResult
)
from chefbotd.components.calibration.events import (
    Ask as Ask, CalibrationData as CalibrationData, Estimate as Estimate, Plot as Plot, Residual as Residual,
    Series as Series, StepResult as StepResult
)
from chefbotd.components.calibration.models import (
    CalibrationApplied as CalibrationApplied, CalibrationReport as CalibrationReport, CalibrationStep as CalibrationStep
)
from chefbotd.components.camera.events import CameraData as CameraData
from chefbotd.components.camera.models import CameraFigures as CameraFigures, CameraFrame as CameraFrame
from chefbotd.components.depth_camera.models import DepthCamerasData as DepthCamerasData
from chefbotd.components.invitations.models import (
    AccessOverview as AccessOverview, AdmittedDevice as AdmittedDevice, InvitationMade as InvitationMade,
    InvitationRedeemed as InvitationRedeemed, OpenInvitation as OpenInvitation
)
from chefbotd.components.localization.models import (
    LocalizationData as LocalizationData, PlaceCandidate as PlaceCandidate
)
from chefbotd.components.map_edits.models import (
    MapEditData as MapEditData, MapEditList as MapEditList, MapEditsData as MapEditsData, MapEditsSaved as MapEditsSaved
)
from chefbotd.components.mapping.models import MapData as MapData, MapPoseData as MapPoseData
from chefbotd.components.maps.events import MapSaved as MapSaved, MappingData as MappingData
from chefbotd.components.maps.models import (
    GridPartData as GridPartData, MapInUse as MapInUse, MapList as MapList, MapPart as MapPart,
    MapSummary as MapSummary, PlaceData as PlaceData, PlaceList as PlaceList
)
from chefbotd.components.navigation.algorithms.arrival import ArrivalData as ArrivalData
from chefbotd.components.navigation.events import (
    ActiveGoal as ActiveGoal, GoalList as GoalList, GoalReport as GoalReport, GoalResult as GoalResult,
    NavigationData as NavigationData, PathData as PathData, PlanResult as PlanResult
)
from chefbotd.components.navigation.models import (
    CostmapData as CostmapData, DynamicObstacleData as DynamicObstacleData, ObstaclesData as ObstaclesData
)
from chefbotd.components.notifications.events import NotificationsData as NotificationsData, ToldServer as ToldServer
from chefbotd.components.recording.models import (
    RecordingEnded as RecordingEnded, RecordingList as RecordingList, RecordingStarted as RecordingStarted,
    RingSaved as RingSaved
)
from chefbotd.components.recording.status import RecordedFile as RecordedFile
from chefbotd.components.simulation.models import SimData as SimData, SimulatedDisc as SimulatedDisc
from chefbotd.components.statistics.models import StatsData as StatsData
from chefbotd.components.tuning.models import Wheels as Wheels
from chefbotd.components.zones.models import (
    ZoneData as ZoneData, ZoneList as ZoneList, ZonesData as ZonesData, ZonesSaved as ZonesSaved
)
from chefbotd.core.events.board import FirmwareData as FirmwareData
from chefbotd.core.events.lidars import DepthCameraChanged as DepthCameraChanged
from chefbotd.core.events.robot import (
    BatteryData as BatteryData, ImuData as ImuData, OdometryConditionData as OdometryConditionData,
    RecordingData as RecordingData, WorkerData as WorkerData
)
from chefbotd.core.record import LogLine as LogLine
from chefbotd.driving.board.models import (
    LinkData as LinkData, RawData as RawData, ResetData as ResetData, TextData as TextData
)
from chefbotd.driving.description.models import RobotDescription as RobotDescription
from chefbotd.driving.lidars.models import LidarData as LidarData, LidarsData as LidarsData, ScanData as ScanData
from chefbotd.driving.models import (
    DriveWarningData as DriveWarningData, Driven as Driven, Limited as Limited, SafetyData as SafetyData,
    Stopped as Stopped, WheelSpeedsSet as WheelSpeedsSet, WheelsData as WheelsData
)
from chefbotd.driving.odometry.models import OdometryData as OdometryData
from chefbotd.driving.sensors.models import RangeData as RangeData, RangesData as RangesData
from chefbotd.features.log_topic import LogData as LogData, StampedLine as StampedLine
from chefbotd.rpc.encoding import UnknownData as UnknownData
from chefbotd.rpc.models import (
    Authenticated as Authenticated, ControlTaken as ControlTaken, Description as Description, Done as Done,
    ErrorDescription as ErrorDescription, MethodDescription as MethodDescription,
    PluginDescription as PluginDescription, PluginList as PluginList, Pong as Pong, Released as Released,
    Subscribed as Subscribed, TopicDescription as TopicDescription
)
from chefbotd.client.event import Latest
from chefbotd.rpc.encoding import Sent

DATA_BY_TOPIC: Mapping[str, type[Sent]] = {
    "recording": RecordingData, "scan": ScanData, "lidars": LidarsData, "map_edits": MapEditsData, "zones": ZonesData,
    "worker": WorkerData, "mapping": MappingData, "map": MapData, "map_pose": MapPoseData,
    "localization": LocalizationData, "navigation": NavigationData, "arrival": ArrivalData, "path": PathData,
    "costmap": CostmapData, "obstacles": ObstaclesData, "depth_cameras": DepthCamerasData, "wheels": WheelsData,
    "safety": SafetyData, "drive_warning": DriveWarningData, "odometry": OdometryData,
    "odometry_condition": OdometryConditionData, "imu": ImuData, "ranges": RangesData, "battery": BatteryData,
    "stats": StatsData, "agents": AgentsData, "agent_events": AgentEventData, "agent_data": AgentMessageData,
    "calibration": CalibrationData, "sim": SimData, "notifications": NotificationsData, "camera": CameraData,
    "link": LinkData, "firmware": FirmwareData, "reset": ResetData, "text": TextData, "raw": RawData, "log": LogData
}
"""What a client reads each topic as."""


class TopicsOfState:
    """The latest data of each topic that a state may have."""

    __slots__ = ()

    recording = Latest("recording", RecordingData)
    scan = Latest("scan", ScanData)
    lidars = Latest("lidars", LidarsData)
    map_edits = Latest("map_edits", MapEditsData)
    zones = Latest("zones", ZonesData)
    worker = Latest("worker", WorkerData)
    mapping = Latest("mapping", MappingData)
    map = Latest("map", MapData)
    map_pose = Latest("map_pose", MapPoseData)
    localization = Latest("localization", LocalizationData)
    navigation = Latest("navigation", NavigationData)
    arrival = Latest("arrival", ArrivalData)
    path = Latest("path", PathData)
    costmap = Latest("costmap", CostmapData)
    obstacles = Latest("obstacles", ObstaclesData)
    depth_cameras = Latest("depth_cameras", DepthCamerasData)
    wheels = Latest("wheels", WheelsData)
    drive_warning = Latest("drive_warning", DriveWarningData)
    odometry = Latest("odometry", OdometryData)
    odometry_condition = Latest("odometry_condition", OdometryConditionData)
    imu = Latest("imu", ImuData)
    ranges = Latest("ranges", RangesData)
    battery = Latest("battery", BatteryData)
    stats = Latest("stats", StatsData)
    agents = Latest("agents", AgentsData)
    agent_events = Latest("agent_events", AgentEventData)
    agent_data = Latest("agent_data", AgentMessageData)
    calibration = Latest("calibration", CalibrationData)
    sim = Latest("sim", SimData)
    notifications = Latest("notifications", NotificationsData)
    camera = Latest("camera", CameraData)
    firmware = Latest("firmware", FirmwareData)
    reset = Latest("reset", ResetData)
    text = Latest("text", TextData)
    raw = Latest("raw", RawData)
    log = Latest("log", LogData)
