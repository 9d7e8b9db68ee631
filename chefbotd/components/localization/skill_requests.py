"""What the skill ``localization`` is asked; it tells the events of ``core.events.mapping``.

The daemon's side loads neither numpy nor a compiler.
"""

from pathlib import Path
from typing import Final, TypeAlias

import msgspec

from chefbotd.components.localization.parameters import LocalizationSection
from chefbotd.components.worker.messages import Message
from chefbotd.core.parameters import Parameters

SKILL: Final = "localization"
POSE_FILE: Final = "last_pose.json"
"""In the folder of maps."""


class LocalizationSkillParameters(Parameters):
    """What the daemon tells the skill when it starts it: its section, with the names of all lidars where it has none."""

    lidars: tuple[str, ...]
    folder: Path
    localization: LocalizationSection


# Requests


class UseMap(Message, frozen=True, tag="use_map"):
    """Find the way on this version of a stored map; the pose that was kept for it is tried first.

    Where this version was in use as ``renamed_from``, only its name changes.
    """

    name: str
    version: int
    renamed_from: str | None = None


class UseEdits(Message, frozen=True, tag="use_edits"):
    """Read the edits of the map in use again, and find the way by them; its pose stays."""


class UseNone(Message, frozen=True, tag="use_none"):
    """There is no map, or one is being made: rest."""


class SetPose(Message, frozen=True, tag="set_pose"):
    """A person says where the robot is, about."""

    x_m: float
    y_m: float
    heading_rad: float


class Localize(Message, frozen=True, tag="localize"):
    """Search everywhere."""


LocalizationRequest: TypeAlias = UseMap | UseEdits | UseNone | SetPose | Localize

REQUEST: Final = msgspec.msgpack.Decoder(LocalizationRequest)
