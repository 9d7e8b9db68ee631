"""The robot's pose and its map, from mapping and localization; and the map that is being made."""

from typing import Final

from chefbotd.bus import Bus
from chefbotd.components.maps.events import MappingChanged
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.core.commands import RefusalKind
from chefbotd.core.events.robot import POSE_ENDED, MapPoseUpdated
from chefbotd.core.geometry import Pose2D
from chefbotd.core.sentence import Sentence

SURE: Final = ("mapping", "localized")
"""States in which the scans fit; in any other the pose may be wrong, and a place of it with it."""

MOST_AGE_S: Final = 2.0


class RobotPose:
    """Keeps the last pose, and whether a map is being made."""

    def __init__(self, bus: Bus) -> None:
        self._pose: MapPoseUpdated | None = None
        self._mapping: MappingChanged | None = None
        bus.add_handler(self._note_pose, MapPoseUpdated)
        bus.add_handler(self._note_mapping, MappingChanged)

    def _note_pose(self, event: MapPoseUpdated) -> None:
        self._pose = event

    def _note_mapping(self, event: MappingChanged) -> None:
        self._mapping = event

    @property
    def is_mapping(self) -> bool:
        """Whether a map is being made: then poses are in that one."""
        return self._mapping is not None and self._mapping.state != "idle"

    @property
    def mapped(self) -> str | None:
        """The stored map with which mapping goes on; None for a new one."""
        return None if self._mapping is None else self._mapping.name

    def pose_in(self, of_map: str, in_use: str | None, now_s: float) -> Pose2D:
        """Where the robot is in a map.

        Raises:
            MapStoreError: that is not known; it says why.
        """
        pose = self._pose
        if (self.mapped if self.is_mapping else in_use) != of_map:
            why = (
                Sentence("maps.other_made", "another map is being made")
                if self.is_mapping
                else Sentence("maps.other_used", "another map is in use")
            )
        elif pose is None or pose.state == POSE_ENDED or now_s - pose.stamp_s > MOST_AGE_S:
            why = Sentence("maps.nothing_tells", "nothing tells it at present")
        elif pose.state not in SURE:
            why = Sentence("maps.pose_is", "it is {state}", state=pose.state.replace("_", " "))
        else:
            return pose.map_from_base
        raise MapStoreError(
            RefusalKind.POSE_UNKNOWN,
            Sentence(
                "maps.pose_unknown",
                "where the robot is in the map {map!r} is not known ({why}): wait until it is localized, "
                "which takes some seconds after a map was loaded, or say where it is",
                map=of_map,
                why=why,
            ),
        )
