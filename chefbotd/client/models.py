"""Every model that a client reads: the results of the methods, and the data of the topics."""

from collections.abc import Mapping

from chefbotd.features.board.methods import LinkData, RawData, ResetData, TextData
from chefbotd.features.depth_cameras.methods import DepthCameraData, DepthCamerasData
from chefbotd.features.description.methods import RobotDescription
from chefbotd.features.driving.methods import Driven, Limited, SafetyData, WheelsData, WheelsDriven
from chefbotd.features.lidars.methods import LidarData, LidarsData, ScanData
from chefbotd.features.localization.methods import LocalizationData, LocalizationResult, PlaceCandidate
from chefbotd.features.mapping.methods import MapData, MappingData, MappingResult, MapPoseData, MapSaved
from chefbotd.features.maps.methods import MapInUse, MapList, MapPart, MapSummary, PlaceData, PlaceList
from chefbotd.features.navigation.methods import (
    CostmapData,
    DynamicObstacleData,
    GoalResult,
    NavigationData,
    ObstaclesData,
    PathData,
    PlanResult,
)
from chefbotd.features.odometry.methods import OdometryData
from chefbotd.features.recording.methods import (
    RecordedFile,
    RecordingData,
    RecordingEnded,
    RecordingList,
    RecordingStarted,
    RingSaved,
)
from chefbotd.features.sensors.methods import BatteryData, ImuData, RangesData
from chefbotd.features.simulation.methods import SimData
from chefbotd.features.statistics.methods import StatsData
from chefbotd.features.tuning.methods import Wheels
from chefbotd.features.worker.methods import WorkerData
from chefbotd.rpc.models import (
    Description,
    Known,
    Pong,
    Released,
    Result,
    Taken,
    TopicData,
    UnknownData,
)

__all__ = [
    "DATA_BY_TOPIC",
    "BatteryData",
    "CostmapData",
    "DepthCameraData",
    "DepthCamerasData",
    "Description",
    "Driven",
    "DynamicObstacleData",
    "GoalResult",
    "ImuData",
    "Known",
    "LidarData",
    "LidarsData",
    "Limited",
    "LinkData",
    "LocalizationData",
    "LocalizationResult",
    "MapData",
    "MapInUse",
    "MapList",
    "MapPart",
    "MapPoseData",
    "MapSaved",
    "MapSummary",
    "MappingData",
    "MappingResult",
    "NavigationData",
    "ObstaclesData",
    "OdometryData",
    "PathData",
    "PlaceCandidate",
    "PlaceData",
    "PlaceList",
    "PlanResult",
    "Pong",
    "RangesData",
    "RawData",
    "RecordedFile",
    "RecordingData",
    "RecordingEnded",
    "RecordingList",
    "RecordingStarted",
    "Released",
    "ResetData",
    "Result",
    "RingSaved",
    "RobotDescription",
    "SafetyData",
    "ScanData",
    "SimData",
    "StatsData",
    "Taken",
    "TextData",
    "TopicData",
    "UnknownData",
    "Wheels",
    "WheelsData",
    "WheelsDriven",
    "WorkerData",
]

DATA_BY_TOPIC: Mapping[str, type[TopicData]] = {
    "odometry": OdometryData,
    "wheels": WheelsData,
    "imu": ImuData,
    "ranges": RangesData,
    "battery": BatteryData,
    "link": LinkData,
    "safety": SafetyData,
    "reset": ResetData,
    "text": TextData,
    "raw": RawData,
    "stats": StatsData,
    "sim": SimData,
    "scan": ScanData,
    "lidars": LidarsData,
    "depth_cameras": DepthCamerasData,
    "worker": WorkerData,
    "localization": LocalizationData,
    "mapping": MappingData,
    "map": MapData,
    "map_pose": MapPoseData,
    "navigation": NavigationData,
    "path": PathData,
    "costmap": CostmapData,
    "obstacles": ObstaclesData,
    "recording": RecordingData,
}
"""What a client reads each topic as."""
