# Written by `make client`: see tests/chefbotd/client/generate.py. Whatever is changed here by hand is lost.
# fmt: off
# mypy: disable-error-code="no-any-return"
"""The client's methods that only ask, and the types of ``subscribe``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Literal, Unpack, overload

from chefbotd.client.caller import MethodCaller
from chefbotd.client.subscription import SubscribeOptions as Options, Subscription

if TYPE_CHECKING:
    from chefbotd.client import models as m
    from chefbotd.client.wire import ProgressListener

from chefbotd.components.map_edits.client_methods import MapEditMethods
from chefbotd.components.maps.client_methods import MapMethods
from chefbotd.components.navigation.client_methods import NavigationMethods
from chefbotd.components.zones.client_methods import ZoneMethods


class ComponentMethods(MapMethods, MapEditMethods, ZoneMethods, NavigationMethods):
    """The methods that components have written by hand."""


class GeneratedMethods(MethodCaller):
    """The methods of the socket for which asking is all there is to do."""

    async def authenticate(self, token: str) -> m.Authenticated:
        """Authenticate with a token; its role decides which methods the client may call."""
        return await self._ask("Authenticated", "authenticate", token=token)

    async def set_client_name(self, client: str) -> None:
        """Set the name under which other clients see this one."""
        await self._ask(None, "set_client_name", client=client)

    async def describe(self) -> m.Description:
        """Describe the methods, topics and errors, with their JSON Schemas."""
        return await self._ask("Description", "describe")

    async def list_plugins(self) -> m.PluginList:
        """The plug-ins that the configuration allows, and what became of each."""
        return await self._ask("PluginList", "list_plugins")

    async def ping(self) -> m.Pong:
        """Answer at once, with the daemon's time."""
        return await self._ask("Pong", "ping")

    async def start_recording(self, name: str | None = None,
        on_progress: ProgressListener | None = None) -> m.RecordingStarted:
        """Record everything into a file on the robot's computer, until stop_recording."""
        return await self._ask("RecordingStarted", "start_recording", name=name, on_progress=on_progress)

    async def stop_recording(self, on_progress: ProgressListener | None = None) -> m.RecordingEnded:
        """End the recording."""
        return await self._ask("RecordingEnded", "stop_recording", on_progress=on_progress)

    async def list_recordings(self, on_progress: ProgressListener | None = None) -> m.RecordingList:
        """Every recording in the robot's folder."""
        return await self._ask("RecordingList", "list_recordings", on_progress=on_progress)

    async def save_ring(self, reason: str | None = None, on_progress: ProgressListener | None = None) -> m.RingSaved:
        """Write the last minutes from the ring buffer in memory into a file."""
        return await self._ask("RingSaved", "save_ring", reason=reason, on_progress=on_progress)

    async def list_maps(self, on_progress: ProgressListener | None = None) -> m.MapList:
        """List the stored maps, whether each is intact, and which one is in use."""
        return await self._ask("MapList", "list_maps", on_progress=on_progress)

    async def load_map(self, name: str, *, resolution_is_right: bool = False,
        on_progress: ProgressListener | None = None) -> m.MapInUse:
        """Use a map from now on, and after a restart."""
        return await self._ask("MapInUse", "load_map", name=name, resolution_is_right=resolution_is_right,
            on_progress=on_progress)

    async def import_map(self, yaml: str, name: str | None = None, *, replace: bool = False,
        on_progress: ProgressListener | None = None) -> m.MapInUse:
        """Store the map of map_server's files on the robot's computer."""
        return await self._ask("MapInUse", "import_map", yaml=yaml, name=name, replace=replace, on_progress=on_progress)

    async def rename_map(self, name: str, new_name: str, on_progress: ProgressListener | None = None) -> None:
        """Give a map another name."""
        await self._ask(None, "rename_map", name=name, new_name=new_name, on_progress=on_progress)

    async def copy_map(self, name: str, new_name: str, on_progress: ProgressListener | None = None) -> m.MapInUse:
        """Keep a copy of a map to go back to, with its places, its zones and its edits; the map in use stays so."""
        return await self._ask("MapInUse", "copy_map", name=name, new_name=new_name, on_progress=on_progress)

    async def delete_map(self, name: str, on_progress: ProgressListener | None = None) -> None:
        """Remove a map with all its versions and places."""
        await self._ask(None, "delete_map", name=name, on_progress=on_progress)

    async def start_mapping(self, name: str | None = None, *, unfinished: bool = False,
        on_progress: ProgressListener | None = None) -> m.MappingData:
        """Begin a map, continue a saved one by its name, or continue after a pause."""
        return await self._ask("MappingData", "start_mapping", name=name, unfinished=unfinished,
            on_progress=on_progress)

    async def pause_mapping(self, on_progress: ProgressListener | None = None) -> m.MappingData:
        """Pause mapping until start_mapping is sent."""
        return await self._ask("MappingData", "pause_mapping", on_progress=on_progress)

    async def finish_mapping(self, name: str, on_progress: ProgressListener | None = None) -> m.MapSaved:
        """Match all scans once more, save the map under a name, and end; reports progress."""
        return await self._ask("MapSaved", "finish_mapping", name=name, on_progress=on_progress)

    async def discard_mapping(self, on_progress: ProgressListener | None = None) -> m.MappingData:
        """End without saving, and forget the map that was never finished; saved maps stay."""
        return await self._ask("MappingData", "discard_mapping", on_progress=on_progress)

    async def set_pose(self, x_m: float, y_m: float, heading_rad: float = 0.0,
        on_progress: ProgressListener | None = None) -> m.LocalizationData:
        """Set the robot's approximate pose in the map in use; the next scans confirm it, or it searches."""
        return await self._ask("LocalizationData", "set_pose", x_m=x_m, y_m=y_m, heading_rad=heading_rad,
            on_progress=on_progress)

    async def localize(self, *, turn: bool = False, if_stop_number: int | None = None,
        on_progress: ProgressListener | None = None) -> m.LocalizationData:
        """Search the whole map for the robot's pose; the robot does not move, unless ``turn`` allows one turn."""
        return await self._ask("LocalizationData", "localize", turn=turn, if_stop_number=if_stop_number,
            on_progress=on_progress)

    async def get_goal(self, goal: int | None = None, goal_id: str | None = None) -> m.GoalReport:
        """What became of a goal; the ends of the last 400 are remembered until the daemon ends."""
        return await self._ask("GoalReport", "get_goal", goal=goal, goal_id=goal_id)

    async def list_goals(self) -> m.GoalList:
        """The goals that have not ended, in the order in which they are driven to."""
        return await self._ask("GoalList", "list_goals")

    async def plan_to(self, x_m: float | None = None, y_m: float | None = None, heading_rad: float | None = None,
        place: str | None = None, tolerance_m: float = 0.0, max_speed_m_s: float | None = None,
        on_progress: ProgressListener | None = None) -> m.PlanResult:
        """Plan a path without driving: whether there is one, its length, and the time it takes."""
        return await self._ask("PlanResult", "plan_to", x_m=x_m, y_m=y_m, heading_rad=heading_rad, place=place,
            tolerance_m=tolerance_m, max_speed_m_s=max_speed_m_s, on_progress=on_progress)

    async def cancel_navigation(self) -> None:
        """End all goals; the robot comes to rest."""
        await self._ask(None, "cancel_navigation")

    async def pause_navigation(self) -> None:
        """Stop the robot, and keep its goals."""
        await self._ask(None, "pause_navigation")

    async def resume_navigation(self, *, if_stop_number: int | None = None) -> None:
        """Continue with the goals from the robot's present pose."""
        await self._ask(None, "resume_navigation", if_stop_number=if_stop_number)

    async def arm(self, latch: int | None = None) -> None:
        """Allow motion after an emergency stop or a fault; with ``latch``, only if that one is the newest."""
        await self._ask(None, "arm", latch=latch)

    async def reset_odometry(self, x_m: float = 0.0, y_m: float = 0.0, heading_rad: float = 0.0) -> None:
        """Set the robot's pose in odom; the default is the origin."""
        await self._ask(None, "reset_odometry", x_m=x_m, y_m=y_m, heading_rad=heading_rad)

    async def get_stats(self) -> m.StatsData:
        """The present values of the daemon's counters."""
        return await self._ask("StatsData", "get_stats")

    async def register_agent(self, name: str, version: str, methods: list[str] | None = None) -> None:
        """Be an agent of this name, which no other may have, until the connection ends."""
        await self._ask(None, "register_agent", name=name, version=version, methods=methods)

    async def say(self, text: str) -> None:
        """Say a sentence to people: on the page and in the log. At most 10 at once, and 2 a second."""
        await self._ask(None, "say", text=text)

    async def ask(self, question: str, choices: list[str], timeout_s: float = 60.0,
        on_progress: ProgressListener | None = None) -> m.AskResult:
        """Ask people a question; the answer is what one of them chose, or that nobody did in time."""
        return await self._ask("AskResult", "ask", question=question, choices=choices, timeout_s=timeout_s,
            on_progress=on_progress)

    async def add_button(self, label: str) -> m.ButtonAdded:
        """Offer people a button; each press of it comes on the topic agent_events."""
        return await self._ask("ButtonAdded", "add_button", label=label)

    async def remove_button(self, button_id: int) -> None:
        """Take back a button of this agent."""
        await self._ask(None, "remove_button", button_id=button_id)

    async def publish_to_topic(self, topic: str, data: dict[str, Any]) -> None:
        """Publish data on a topic of this agent; they come on the topic agent_data."""
        await self._ask(None, "publish_to_topic", topic=topic, data=data)

    async def answer_call(self, call_id: int, result: dict[str, Any] | None = None, error: str | None = None) -> None:
        """Answer a call of a method of this agent, which came on the topic agent_events."""
        await self._ask(None, "answer_call", call_id=call_id, result=result, error=error)

    async def press_button(self, button_id: int) -> None:
        """Press a button; its agent is told."""
        await self._ask(None, "press_button", button_id=button_id)

    async def answer_agent(self, question_id: int, choice: str) -> None:
        """Choose one of the answers to a question; the first answer counts."""
        await self._ask(None, "answer_agent", question_id=question_id, choice=choice)

    async def call_agent(self, agent: str, method: str, params: dict[str, Any] | None = None, timeout_s: float = 5.0,
        on_progress: ProgressListener | None = None) -> m.CallResult:
        """Call a method that an agent offers, and wait for its answer."""
        return await self._ask("CallResult", "call_agent", agent=agent, method=method, params=params,
            timeout_s=timeout_s, on_progress=on_progress)

    async def get_calibration(self, on_progress: ProgressListener | None = None) -> m.CalibrationReport:
        """Return every step that can be calibrated, and the newest result of each."""
        return await self._ask("CalibrationReport", "get_calibration", on_progress=on_progress)

    async def calibrate(self, step: str, space_m: float | None = None, *, if_stop_number: int | None = None,
        on_progress: ProgressListener | None = None) -> m.StepResult:
        """Carry out a step of the calibration; the robot moves. Nothing is written before ``apply_calibration``."""
        return await self._ask("StepResult", "calibrate", step=step, space_m=space_m, if_stop_number=if_stop_number,
            on_progress=on_progress)

    async def answer_calibration(self, key: str, value: float) -> None:
        """Answer the question that the calibration asks."""
        await self._ask(None, "answer_calibration", key=key, value=value)

    async def apply_calibration(self, steps: list[str] | None = None,
        on_progress: ProgressListener | None = None) -> m.CalibrationApplied:
        """Write results into the daemon's configuration, which keeps its comments; the old file is kept beside it."""
        return await self._ask("CalibrationApplied", "apply_calibration", steps=steps, on_progress=on_progress)

    async def send_test_notification(self) -> None:
        """Send a message to every server, to try it; none to one for which such a message is still waiting."""
        await self._ask(None, "send_test_notification")

    async def make_invitation(self, role: Literal['observe', 'guest', 'agent', 'drive', 'admin'] = 'guest',
        access_s: float | None = None, lifetime_s: float = 300.0, *, approval: bool = False, name: str = '',
        on_progress: ProgressListener | None = None) -> m.InvitationMade:
        """Make an invitation, which lets one phone in: a link, its QR code, and a short code to type."""
        return await self._ask("InvitationMade", "make_invitation", role=role, access_s=access_s, lifetime_s=lifetime_s,
            approval=approval, name=name, on_progress=on_progress)

    async def redeem_invitation(self, secret: str, device: str = 'a phone',
        on_progress: ProgressListener | None = None) -> m.InvitationRedeemed:
        """Come in by an invitation; answers the token to keep, or a ticket while somebody has to approve."""
        return await self._ask("InvitationRedeemed", "redeem_invitation", secret=secret, device=device,
            on_progress=on_progress)

    async def approve_invitation(self, invitation: int) -> None:
        """Let in the phone that waits with this invitation."""
        await self._ask(None, "approve_invitation", invitation=invitation)

    async def list_invitations(self) -> m.AccessOverview:
        """The open invitations, and those who were let in by one."""
        return await self._ask("AccessOverview", "list_invitations")

    async def revoke_access(self, invitation: int | None = None, device: int | None = None,
        on_progress: ProgressListener | None = None) -> None:
        """Close an invitation, or end the access of somebody who was let in and disconnect them."""
        await self._ask(None, "revoke_access", invitation=invitation, device=device, on_progress=on_progress)

    async def get_camera_frame(self, after: int = 0, wait_s: float = 5.0,
        on_progress: ProgressListener | None = None) -> m.CameraFrame:
        """Wait for the next picture of the camera, which runs while somebody asks."""
        return await self._ask("CameraFrame", "get_camera_frame", after=after, wait_s=wait_s, on_progress=on_progress)

    async def get_camera_status(self) -> m.CameraFigures:
        """How the camera is, and what it did since the daemon's start."""
        return await self._ask("CameraFigures", "get_camera_status")

    async def reset_board(self) -> None:
        """Restart the board; its counters start at zero."""
        await self._ask(None, "reset_board")


class Topics(ABC):
    """``subscribe``, typed by the name of the topic."""

    @overload
    def subscribe(self, topics: Literal["recording"], **options: Unpack[Options]) -> Subscription[m.RecordingData]: ...
    @overload
    def subscribe(self, topics: Literal["scan"], **options: Unpack[Options]) -> Subscription[m.ScanData]: ...
    @overload
    def subscribe(self, topics: Literal["lidars"], **options: Unpack[Options]) -> Subscription[m.LidarsData]: ...
    @overload
    def subscribe(self, topics: Literal["map_edits"], **options: Unpack[Options]) -> Subscription[m.MapEditsData]: ...
    @overload
    def subscribe(self, topics: Literal["zones"], **options: Unpack[Options]) -> Subscription[m.ZonesData]: ...
    @overload
    def subscribe(self, topics: Literal["worker"], **options: Unpack[Options]) -> Subscription[m.WorkerData]: ...
    @overload
    def subscribe(self, topics: Literal["mapping"], **options: Unpack[Options]) -> Subscription[m.MappingData]: ...
    @overload
    def subscribe(self, topics: Literal["map"], **options: Unpack[Options]) -> Subscription[m.MapData]: ...
    @overload
    def subscribe(self, topics: Literal["map_pose"], **options: Unpack[Options]) -> Subscription[m.MapPoseData]: ...
    @overload
    def subscribe(self, topics: Literal["localization"],
        **options: Unpack[Options]) -> Subscription[m.LocalizationData]: ...
    @overload
    def subscribe(self, topics: Literal["navigation"],
        **options: Unpack[Options]) -> Subscription[m.NavigationData]: ...
    @overload
    def subscribe(self, topics: Literal["arrival"], **options: Unpack[Options]) -> Subscription[m.ArrivalData]: ...
    @overload
    def subscribe(self, topics: Literal["path"], **options: Unpack[Options]) -> Subscription[m.PathData]: ...
    @overload
    def subscribe(self, topics: Literal["costmap"], **options: Unpack[Options]) -> Subscription[m.CostmapData]: ...
    @overload
    def subscribe(self, topics: Literal["obstacles"], **options: Unpack[Options]) -> Subscription[m.ObstaclesData]: ...
    @overload
    def subscribe(self, topics: Literal["depth_cameras"],
        **options: Unpack[Options]) -> Subscription[m.DepthCamerasData]: ...
    @overload
    def subscribe(self, topics: Literal["wheels"], **options: Unpack[Options]) -> Subscription[m.WheelsData]: ...
    @overload
    def subscribe(self, topics: Literal["safety"], **options: Unpack[Options]) -> Subscription[m.SafetyData]: ...
    @overload
    def subscribe(self, topics: Literal["drive_warning"],
        **options: Unpack[Options]) -> Subscription[m.DriveWarningData]: ...
    @overload
    def subscribe(self, topics: Literal["odometry"], **options: Unpack[Options]) -> Subscription[m.OdometryData]: ...
    @overload
    def subscribe(self, topics: Literal["odometry_condition"],
        **options: Unpack[Options]) -> Subscription[m.OdometryConditionData]: ...
    @overload
    def subscribe(self, topics: Literal["imu"], **options: Unpack[Options]) -> Subscription[m.ImuData]: ...
    @overload
    def subscribe(self, topics: Literal["ranges"], **options: Unpack[Options]) -> Subscription[m.RangesData]: ...
    @overload
    def subscribe(self, topics: Literal["battery"], **options: Unpack[Options]) -> Subscription[m.BatteryData]: ...
    @overload
    def subscribe(self, topics: Literal["stats"], **options: Unpack[Options]) -> Subscription[m.StatsData]: ...
    @overload
    def subscribe(self, topics: Literal["agents"], **options: Unpack[Options]) -> Subscription[m.AgentsData]: ...
    @overload
    def subscribe(self, topics: Literal["agent_events"],
        **options: Unpack[Options]) -> Subscription[m.AgentEventData]: ...
    @overload
    def subscribe(self, topics: Literal["agent_data"],
        **options: Unpack[Options]) -> Subscription[m.AgentMessageData]: ...
    @overload
    def subscribe(self, topics: Literal["calibration"],
        **options: Unpack[Options]) -> Subscription[m.CalibrationData]: ...
    @overload
    def subscribe(self, topics: Literal["sim"], **options: Unpack[Options]) -> Subscription[m.SimData]: ...
    @overload
    def subscribe(self, topics: Literal["notifications"],
        **options: Unpack[Options]) -> Subscription[m.NotificationsData]: ...
    @overload
    def subscribe(self, topics: Literal["camera"], **options: Unpack[Options]) -> Subscription[m.CameraData]: ...
    @overload
    def subscribe(self, topics: Literal["link"], **options: Unpack[Options]) -> Subscription[m.LinkData]: ...
    @overload
    def subscribe(self, topics: Literal["firmware"], **options: Unpack[Options]) -> Subscription[m.FirmwareData]: ...
    @overload
    def subscribe(self, topics: Literal["reset"], **options: Unpack[Options]) -> Subscription[m.ResetData]: ...
    @overload
    def subscribe(self, topics: Literal["text"], **options: Unpack[Options]) -> Subscription[m.TextData]: ...
    @overload
    def subscribe(self, topics: Literal["raw"], **options: Unpack[Options]) -> Subscription[m.RawData]: ...
    @overload
    def subscribe(self, topics: Literal["log"], **options: Unpack[Options]) -> Subscription[m.LogData]: ...
    @overload
    def subscribe(self, topics: str | Iterable[str], **options: Unpack[Options]) -> Subscription[Any]: ...

    def subscribe(self, topics: str | Iterable[str], **options: Unpack[Options]) -> Subscription[Any]:
        """Events of one or several topics, first the latest value of each; see ``Subscription``.

        Subscriptions of one client to the same topic share it, and have the same rate and policy.

        Raises:
            SubscriptionConflict: on starting, when the topic is subscribed with another rate or policy.
        """
        return self._subscription(topics, **options)

    @abstractmethod
    def _subscription(self, topics: str | Iterable[str], **options: Unpack[Options]) -> Subscription[Any]: ...
