"""The section ``[navigation]``; needs no numpy."""

from pydantic import Field

from chefbotd.components.navigation.algorithms.states import UnknownSpace
from chefbotd.core.parameters import Parameters


class NavigationSection(Parameters):
    """How fast the robot drives by itself, and what it does after a person has driven meanwhile."""

    max_speed_m_s: float = Field(default=0.30, gt=0, le=10)
    """No faster than this; 0.30 m/s is the fastest that navigation was tried with."""
    unknown_space: UnknownSpace = UnknownSpace.BLOCKED
    """Whether paths lead through what the map knows nothing of: blocked, avoided (at six times the cost) or free."""
    comfort_m: float = Field(default=0.30, gt=0, le=5)
    """Paths keep so far from what stands where there is room; more room than that beside the robot is worth nothing."""
    home_place: str = Field(default="home", min_length=1, max_length=64)
    """The place of the map in use to which ``go_home`` drives."""
    dock_place: str = Field(default="dock", min_length=1, max_length=64)
    """The place to which ``dock`` drives: where the robot is charged, with the heading that it needs there."""
    resume_after_takeover: bool = True
    """Whether a goal goes on when whoever took over has let go; otherwise it waits for ``resume_navigation``."""
