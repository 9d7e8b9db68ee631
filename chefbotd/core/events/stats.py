"""The event with the daemon's figures."""

from collections.abc import Mapping

from chefbotd.core.record import Record


class StatsSampled(Record, frozen=True):
    """Every figure of the registry by its name, sampled once a second."""

    stamp_s: float
    figures: Mapping[str, int | float | Mapping[str, int] | None]
