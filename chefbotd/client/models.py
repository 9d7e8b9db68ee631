# Written by `make client`: see tests/chefbotd/client/generate.py. Whatever is changed here by hand is lost.
# fmt: off
"""Every model that a client reads: the results of the methods, and the data of the topics."""

from collections.abc import Mapping

from chefbotd.features.board.methods import (
    LinkData as LinkData, RawData as RawData, ResetData as ResetData, TextData as TextData
)
from chefbotd.features.depth_cameras.methods import (
    DepthCameraData as DepthCameraData, DepthCamerasData as DepthCamerasData
)
from chefbotd.features.description.methods import RobotDescription as RobotDescription
from chefbotd.features.driving.methods import (
    Driven as Driven, Limited as Limited, SafetyData as SafetyData, Stopped as Stopped, WheelsData as WheelsData,
    WheelsDriven as WheelsDriven
)
from chefbotd.features.lidars.methods import LidarData as LidarData, LidarsData as LidarsData, ScanData as ScanData
from chefbotd.features.localization.methods import (
    LocalizationData as LocalizationData, LocalizationResult as LocalizationResult, PlaceCandidate as PlaceCandidate
)
from chefbotd.features.mapping.methods import (
    MapData as MapData, MapPoseData as MapPoseData, MapSaved as MapSaved, MappingData as MappingData,
    MappingResult as MappingResult
)
from chefbotd.features.maps.grid_part import GridPartData as GridPartData
from chefbotd.features.maps.methods import (
    MapInUse as MapInUse, MapList as MapList, MapPart as MapPart, MapSummary as MapSummary, PlaceData as PlaceData,
    PlaceList as PlaceList
)
from chefbotd.features.navigation.methods import (
    CostmapData as CostmapData, DynamicObstacleData as DynamicObstacleData, GoalResult as GoalResult,
    NavigationData as NavigationData, ObstaclesData as ObstaclesData, PathData as PathData, PlanResult as PlanResult
)
from chefbotd.features.odometry.methods import OdometryData as OdometryData
from chefbotd.features.recording.methods import (
    RecordedFile as RecordedFile, RecordingData as RecordingData, RecordingEnded as RecordingEnded,
    RecordingList as RecordingList, RecordingStarted as RecordingStarted, RingSaved as RingSaved
)
from chefbotd.features.sensors.methods import (
    BatteryData as BatteryData, ImuData as ImuData, RangeData as RangeData, RangesData as RangesData
)
from chefbotd.features.simulation.methods import Disc as Disc, SimData as SimData
from chefbotd.features.statistics.methods import StatsData as StatsData
from chefbotd.features.tuning.methods import Wheels as Wheels
from chefbotd.features.worker.methods import WorkerData as WorkerData
from chefbotd.rpc.models import (
    Description as Description, Done as Done, ErrorDescription as ErrorDescription, Known as Known,
    MethodDescription as MethodDescription, Pong as Pong, Released as Released, Result as Result,
    Subscribed as Subscribed, Taken as Taken, TopicData as TopicData, TopicDescription as TopicDescription,
    UnknownData as UnknownData
)

DATA_BY_TOPIC: Mapping[str, type[TopicData]] = {
    "recording": RecordingData, "scan": ScanData, "lidars": LidarsData, "worker": WorkerData, "mapping": MappingData,
    "map": MapData, "map_pose": MapPoseData, "localization": LocalizationData, "navigation": NavigationData,
    "path": PathData, "costmap": CostmapData, "obstacles": ObstaclesData, "depth_cameras": DepthCamerasData,
    "wheels": WheelsData, "safety": SafetyData, "odometry": OdometryData, "imu": ImuData, "ranges": RangesData,
    "battery": BatteryData, "stats": StatsData, "sim": SimData, "link": LinkData, "reset": ResetData, "text": TextData,
    "raw": RawData
}
"""What a client reads each topic as."""
