"""The scenario of ``chefbotctl serve``: the start, the people, and the goals."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from chefbotd.components.simulation.parameters.simulation import PersonParameters, ThingParameters
from chefbotd.core.geometry import Pose2D

START: Final = Pose2D(2.75, 5.35, 2.1)
"""In the bedroom. The robot is not told."""

PLACES: Final[Mapping[str, Pose2D]] = {
    "table 1": Pose2D(2.6, 1.95, -0.6),
    "table 2": Pose2D(5.3, 6.75, 2.4),
    "table 3": Pose2D(7.2, 6.25, 1.3),
    "kitchen": Pose2D(6.4, 1.6, -math.pi / 2),
}
"""Where the robot stands at a table: dining table, desk, and the low table in the child's room."""

TABLES: Final = ("table 1", "table 2", "table 3")
HOME: Final = "kitchen"

PEOPLE: Final = (
    PersonParameters(path_m=((1.3, 2.55), (4.4, 2.55)), speed_m_s=0.5, start_m=1.0, pause_s=2.0),
    PersonParameters(path_m=((5.0, 3.75), (9.2, 3.75)), speed_m_s=0.45, start_m=2.0, pause_s=2.0),
    PersonParameters(path_m=((4.3, 5.3), (5.4, 6.2)), speed_m_s=0.4, pause_s=3.0),
)
"""They cross the living room, walk along the hall, and walk about the study."""

CHAIR: Final = ThingParameters(x_m=3.2, y_m=3.8, radius_m=0.2)
"""In the hall, on the way from the living room to the study. It is on no map."""


def environment(folder: Path) -> dict[str, str]:
    """What makes a daemon simulate this, with its maps in ``folder``; the robot's clock waits for its worker."""
    return {
        "CHEFBOTD_MAPS__FOLDER": str(folder.absolute()),
        "CHEFBOTD_WORKER__NICENESS": "0",
        "CHEFBOTD_SIM__WORLD__START_X_M": repr(START.x_m),
        "CHEFBOTD_SIM__WORLD__START_Y_M": repr(START.y_m),
        "CHEFBOTD_SIM__WORLD__START_HEADING_RAD": repr(START.heading_rad),
        "CHEFBOTD_SIM__PEOPLE": f"[{', '.join(map(_person, PEOPLE))}]",
        "CHEFBOTD_SIM__THINGS": f"[{{x_m = {CHAIR.x_m}, y_m = {CHAIR.y_m}, radius_m = {CHAIR.radius_m}}}]",
    }


def _person(person: PersonParameters) -> str:
    """As TOML."""
    path = ", ".join(f"[{x}, {y}]" for x, y in person.path_m)
    pace = f"speed_m_s = {person.speed_m_s}, start_m = {person.start_m}, pause_s = {person.pause_s}"
    return f"{{path_m = [{path}], {pace}}}"
