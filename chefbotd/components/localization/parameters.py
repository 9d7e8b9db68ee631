"""The section ``[localization]``; needs no numpy."""

from pydantic import Field

from chefbotd.core.parameters import Parameters


class LocalizationSection(Parameters):
    """Which lidars' scans tell where the robot is, and what it may do by itself."""

    lidars: tuple[str, ...] | None = Field(default=None, min_length=1)
    """Their names, the leading one first; all that are configured, if none is named."""
    auto_search: bool = True
    """Whether a robot that is lost looks everywhere without being asked to."""
    turn_at_start: bool = False
    """Whether a robot that has not found itself yet, and cannot by looking for 3 s, may turn once on the spot."""
    save_period_s: float = Field(default=5.0, gt=0, le=3600)
    """How often the pose is kept on disk, at most; a robot that stands is not kept again."""
