"""The messages of the skill ``localization``. The daemon's side loads neither numpy nor a compiler."""

from pathlib import Path
from typing import Final, TypeAlias

import msgspec

from chefbotd.core.parameters import Parameters
from chefbotd.worker.messages import Message

SKILL: Final = "localization"
POSE_FILE: Final = "last_pose.json"
"""In the folder of maps."""


class LocalizationSkillParameters(Parameters):
    """What the daemon tells the skill when it starts it; ``pose_file`` is where the pose is kept from run to run."""

    lidars: tuple[str, ...]
    folder: Path
    pose_file: Path
    auto_search: bool
    save_period_s: float


# Requests


class UseMap(Message, frozen=True, tag="use_map"):
    """Find the way on this version of a stored map; the pose that was kept for it is tried first."""

    name: str
    version: int


class UseNone(Message, frozen=True, tag="use_none"):
    """There is no map, or one is being made: rest."""


class SetPose(Message, frozen=True, tag="set_pose"):
    """A person says where the robot is, about."""

    x_m: float
    y_m: float
    heading_rad: float


class Localize(Message, frozen=True, tag="localize"):
    """Search everywhere."""


LocalizationRequest: TypeAlias = UseMap | UseNone | SetPose | Localize

# Told, and answered


class Located(Message, frozen=True, tag="located"):
    """How localization stands, with each scan and after each request.

    ``map_from_base`` follows the estimate smoothly (``jumped``: it could not); with ``odometry``, where the robot was by
    that, it is None where there is no pose. ``alternatives`` are rows of x, y, heading and fit.
    """

    stamp_s: float
    state: str
    map: str | None
    map_from_base: tuple[float, float, float] | None
    odometry: tuple[float, float, float]
    covariance: tuple[float, float, float, float, float, float]
    fit: float
    jumped: bool
    alternatives: tuple[tuple[float, float, float, float], ...]
    searched: float
    reason: str


REQUEST: Final = msgspec.msgpack.Decoder(LocalizationRequest)
LOCATED: Final = msgspec.msgpack.Decoder(Located)
