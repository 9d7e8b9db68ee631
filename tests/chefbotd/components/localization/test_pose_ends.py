"""The pose in a map ends at once when another map is loaded, and each pose names its map."""

from types import SimpleNamespace
from typing import Any

from chefbotd.bus import Bus
from chefbotd.clock import ManualClock
from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.localization.service import LocalizationService
from chefbotd.components.maps.events import MapLoaded, MapUnloaded
from chefbotd.core.events.robot import MapPoseUpdated
from chefbotd.core.geometry import Pose2D, PoseCovariance
from tests.chefbotd.components.localization.test_jumps import FakeWorker

COVARIANCE = PoseCovariance(0.01, 0.0, 0.0, 0.01, 0.0, 0.01)


class Told:
    """The service on the map ``flat``, localized there, and all that it publishes."""

    def __init__(self) -> None:
        self.worker, self.bus = FakeWorker(), Bus()
        feed: Any = SimpleNamespace(worker=self.worker, in_odom=lambda event: event)
        self.service = LocalizationService(self.bus, ManualClock(1.0), feed)
        self.poses: list[MapPoseUpdated] = []
        self.states: list[LocalizationChanged] = []
        self.load("flat", 0.5)
        self.bus.add_handler(self.poses.append, MapPoseUpdated)
        self.bus.add_handler(self.states.append, LocalizationChanged)
        self.worker.say(1.0, "localized", 1)
        self.say_pose(1.0, "flat")

    def load(self, name: str, stamp_s: float, renamed_from: str | None = None) -> None:
        """Another map is in use, or this one has another name."""
        self.bus.publish(MapLoaded(stamp_s, "/maps", name, 1, renamed_from))

    def say_pose(self, stamp_s: float, of_map: str) -> None:
        """A pose by the worker."""
        pose = Pose2D(1.0, 2.0, 0.3)
        self.worker.listeners[MapPoseUpdated](
            MapPoseUpdated(stamp_s, pose, pose, COVARIANCE, 0.9, "localized", 0.0, of_map)
        )


def test_the_old_pose_ends_when_another_map_is_loaded_and_later_poses_of_the_old_map_are_void() -> None:
    """Ended at once, under the old map's name; the worker is still at it for a turn; then poses of the new one."""
    told = Told()
    told.load("office", 2.0)
    assert [(pose.state, pose.map, pose.stamp_s) for pose in told.poses] == [
        ("localized", "flat", 1.0),
        ("ended", "flat", 2.0),
    ]
    assert told.states[-1].state == "unknown"
    assert "office" in told.states[-1].reason
    told.say_pose(2.1, "flat")
    assert len(told.poses) == 2
    told.say_pose(3.0, "office")
    assert (told.poses[-1].state, told.poses[-1].map) == ("localized", "office")


def test_a_map_that_is_renamed_keeps_its_pose_and_the_pose_has_the_new_name() -> None:
    """The worker still says the old name."""
    told = Told()
    told.load("home", 2.0, renamed_from="flat")
    told.say_pose(2.1, "flat")
    assert [(pose.state, pose.map) for pose in told.poses] == [("localized", "flat"), ("localized", "home")]


def test_a_map_that_is_deleted_ends_the_pose_too() -> None:
    """None is in use then."""
    told = Told()
    told.bus.publish(MapUnloaded(2.0, "flat"))
    assert told.poses[-1].state == "ended"
    assert told.states[-1].state == "unknown"


def test_why_no_map_is_in_use_is_said_until_there_is_one() -> None:
    """Also after the worker itself says that it has none, and by the next state that is asked for."""
    told, why = Told(), "the map flat is not used any more, as it ended the worker: it took 900 MB"
    told.bus.publish(MapUnloaded(2.0, "flat", why))
    told.worker.listeners[LocalizationChanged](LocalizationChanged(2.1, "unknown", None, 0.0, (), 0.0, 0, ""))
    assert {state.reason for state in told.states if state.state == "unknown"} == {why}
    assert told.service.state().why_no_map == why
    told.load("office", 3.0)
    assert told.service.state().why_no_map == ""
