"""The ``[navigation]`` section of the configuration; needs no numpy."""

from pydantic import Field

from chefbotd.core.parameters import Parameters


class NavigationSection(Parameters):
    """How fast the robot drives by itself, and what it does when somebody has driven meanwhile."""

    max_speed_m_s: float = Field(default=0.30, gt=0, le=10)
    """No faster than this; 0.30 m/s is the fastest that navigation was tried with."""
    home_place: str = Field(default="home", min_length=1, max_length=64)
    """The place of the map in use to which ``go_home`` drives;"""
    dock_place: str = Field(default="dock", min_length=1, max_length=64)
    """and ``dock``: where the robot is charged, with the heading that it needs there."""
    resume_after_takeover: bool = True
    """Whether a goal goes on when whoever took over has let go; otherwise it waits for ``resume_navigation``."""
