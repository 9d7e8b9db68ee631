"""What the daemon has counted."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class StatsSampled:
    """Every figure of the registry by its name, sampled once a second."""

    stamp_s: float
    figures: Mapping[str, int | float | Mapping[str, int] | None]
