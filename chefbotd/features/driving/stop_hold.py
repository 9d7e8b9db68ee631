"""Holds sources after a stop, and tells their drivers; the rules are in ``chefbotd.safety.hold``."""

from collections.abc import Collection

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.safety import hold

EMERGENCY_STOP = "an emergency stop"


class StopHold:
    """Remembers who has tried to drive; a source is free when nobody has tried for ``stop_hold_s``."""

    def __init__(self, stop_hold_s: float) -> None:
        self._stop_hold_s = stop_hold_s
        self._attempts: hold.Attempts = ()

    def note_attempt(self, source: str, now_s: float, *, estopped: bool) -> None:
        """Somebody tries to drive; while an e-stop is latched that is held from then on, as what came before it."""
        self._attempts = hold.note_attempt(self._attempts, source, now_s, self._stop_hold_s)
        if estopped:
            self.hold(now_s, EMERGENCY_STOP)

    def hold(self, now_s: float, by: str, excluded: Collection[str] = ()) -> None:
        """A stop: hold what has been driven lately, but for the ``excluded`` sources."""
        self._attempts = hold.hold(self._attempts, now_s, self._stop_hold_s, by, excluded)

    def free(self, sources: Collection[str]) -> None:
        """The drivers of these sources ask anew: no stop holds them any longer."""
        self._attempts = hold.free(self._attempts, sources)

    def require_free(self, source: str) -> None:
        """Raises ``Refused`` where a stop holds the source."""
        stopped_by, stop_hold_s = hold.holder_of(self._attempts, source), self._stop_hold_s
        if stopped_by:
            raise Refused(
                RefusalKind.STOPPED,
                f"{source} was stopped by {stopped_by}: do not drive for {stop_hold_s:g} s, or send arm",
                {"source": source, "stopped_by": stopped_by, "stop_hold_s": stop_hold_s},
            )
