"""What is well and what is not, as diagnostic_msgs/DiagnosticArray: a status for each part of the robot."""

from collections.abc import Callable, Mapping
from typing import Any

from chefbot_ros2.messages import Message, header, ros_type
from chefbotd.client.models import BatteryData, LidarsData, LinkData, LocalizationData, SafetyData, WorkerData
from chefbotd.components.navigation.events import NavigationData

DiagnosticArray = ros_type("diagnostic_msgs/DiagnosticArray")
DiagnosticStatus, KeyValue = (
    ros_type("diagnostic_msgs/DiagnosticStatus"),
    ros_type("diagnostic_msgs/KeyValue"),
)
OK, WARN, ERROR = 0, 1, 2
HARDWARE_ID = "chefbotd"


def status(name: str, level: int, message: str, values: Mapping[str, object] | None = None) -> Any:
    """The status of one part."""
    pairs = [KeyValue(key, str(value)) for key, value in (values or {}).items()]
    return DiagnosticStatus(level, f"chefbot: {name}", message, HARDWARE_ID, pairs)


def diagnostic_array(stamp_ns: int, bridge: Any, latest: Mapping[str, Any]) -> Message:
    """The status of the bridge, and of each topic that has one."""
    statuses = [judge(latest[topic]) for topic, judge in JUDGES.items() if latest.get(topic) is not None]
    return "/diagnostics", DiagnosticArray(header(stamp_ns, ""), [bridge, *statuses])


def _link(data: LinkData) -> Any:
    level = OK if data.healthy else ERROR
    return status("board", level, data.reason or data.condition, {"device": data.device, "state": data.state})


def _safety(data: SafetyData) -> Any:
    level = OK if data.armed else ERROR
    values = {"source": data.source, "fault": data.fault, "limited_by": data.limited_by}
    return status("safety", level, f"{data.mode}: {data.reason}" if data.reason else data.mode, values)


def _battery(data: BatteryData) -> Any:
    level = {"ok": OK, "low": WARN}.get(data.status, ERROR)
    values = {"voltage_v": data.voltage_v, "percentage": data.percentage}
    return status("battery", level, str(data.status), values)


def _worker(data: WorkerData) -> Any:
    level = {"ready": OK, "unavailable": ERROR}.get(data.state, WARN)
    return status("worker", level, f"{data.state}: {data.reason}" if data.reason else data.state)


def _lidars(data: LidarsData) -> Any:
    sick = [lidar for lidar in data.lidars if not lidar.healthy]
    message = "; ".join(f"{lidar.lidar}: {lidar.reason or lidar.condition}" for lidar in sick) or "healthy"
    conditions = {lidar.lidar: lidar.condition for lidar in data.lidars}
    return status("lidars", ERROR if sick else OK, message, conditions)


def _localization(data: LocalizationData) -> Any:
    level = {"localized": OK, "lost": ERROR}.get(data.state, WARN)
    return status("localization", level, data.reason or data.state, {"map": data.map, "fit": data.fit})


def _navigation(data: NavigationData) -> Any:
    failed = data.state in ("unreachable", "blocked", "lost", "fault")
    level = ERROR if failed else OK
    return status("navigation", level, data.reason or data.state, {"state": data.state, "goal": data.goal})


JUDGES: Mapping[str, Callable[[Any], Any]] = {
    "link": _link,
    "safety": _safety,
    "battery": _battery,
    "worker": _worker,
    "lidars": _lidars,
    "localization": _localization,
    "navigation": _navigation,
}
