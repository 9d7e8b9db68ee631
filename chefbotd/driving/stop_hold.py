"""Holds sources after a stop, and refuses their drivers; the rules are in ``chefbotd.safety.hold``."""

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.record import StatefulValue
from chefbotd.core.sentence import Sentence
from chefbotd.safety import hold

EMERGENCY_STOP = "an emergency stop"
FAULT = "a fault"


class StopHold(StatefulValue[hold.State]):
    """Keeps which client has tried to drive which source, and who knows of the stops since. Clients have numbers."""

    def __init__(self, stop_hold_s: float) -> None:
        self._stop_hold_s = stop_hold_s
        self.memory = ()

    def record_attempt(self, source: str, client: int, now_s: float, latched_by: str) -> None:
        """A client tries to drive; ``latched_by``: what is latched meanwhile, if anything is."""
        self.memory = hold.record_attempt(self.memory, source, client, now_s, self._stop_hold_s, latched_by)

    def renew_attempt(self, source: str, client: int, now_s: float) -> bool:
        """Record a client's attempt while nothing is latched; False: a stop holds it, and nothing is recorded."""
        attempted = hold.record_attempt(self.memory, source, client, now_s, self._stop_hold_s)
        if hold.holder_of(attempted, source, client):
            return False
        self.memory = attempted
        return True

    def stop(self, client: int, by: str, now_s: float) -> None:
        """A client of this name stops the robot."""
        self.memory = hold.stop(self.memory, client, by, now_s, self._stop_hold_s)

    def latch(self, by: str, now_s: float) -> None:
        """An emergency stop, whoever sends it, or a fault."""
        self.memory = hold.latch(self.memory, by, now_s, self._stop_hold_s)

    def acknowledge(self, client: int, source: str | None = None) -> None:
        """A client knows of every stop so far, and asks to drive this source (None: any)."""
        self.memory = hold.acknowledge(self.memory, client, source)

    def take_over(
        self, client: int, source: str, now_s: float, latched_by: str, *, from_another: bool
    ) -> None:
        """A client takes control of a source; ``latched_by`` as for a try."""
        self.memory = hold.take_over(
            self.memory, source, client, now_s, self._stop_hold_s, latched_by, from_another=from_another
        )

    def require_free(self, source: str, client: int) -> None:
        """Raise ``Refused`` if a stop holds this client, whose attempt was just noted."""
        stopped_by, stop_hold_s = hold.holder_of(self.memory, source, client), self._stop_hold_s
        if stopped_by:
            raise Refused(
                RefusalKind.STOPPED,
                Sentence(
                    "driving.stopped_by",
                    "{source} was stopped by {stopped_by}: let go for {stop_hold_s:g} s, or arm the robot",
                    source=source,
                    stopped_by=stopped_by,
                    stop_hold_s=stop_hold_s,
                ),
                {"source": source, "stopped_by": stopped_by, "stop_hold_s": stop_hold_s},
            )
