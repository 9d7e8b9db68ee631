"""Clients that try to drive a source of another client. A stop also holds these, or they would drive after it.

Their commands are refused before the keeper of the robot's safety hears of them. When the source is given up, soon after
a stop or an ``arm``, the next of them would move the robot without its driver having asked anew.
"""

from chefbotd.features.driving.stop_hold import EMERGENCY_STOP, StopHold
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.session import Session


class Contenders:
    """Attempts by source of clients that neither have it nor had it last."""

    def __init__(self, leases: ControlLeases) -> None:
        self._leases = leases
        self._held = StopHold(leases.stop_hold_s)
        self._last: dict[str, Session] = {}
        self._estopped = False

    def note_attempt(self, source: str, session: Session, now_s: float) -> None:
        """A client tries to drive; raises ``Refused`` where the source is free, but a stop holds those who try."""
        if self._leases.is_own(source, session, now_s):
            return
        self._held.note_attempt(source, now_s, estopped=self._estopped)
        self._last[source] = session
        if not self._estopped and self._leases.holder(source, now_s) is None:
            self._held.require_free(source)

    def stop(self, session: Session, by: str, now_s: float) -> None:
        """Hold who has tried lately, but for the client that asks for it."""
        self._held.hold(now_s, by, self._of(session))

    def estop(self, now_s: float) -> None:
        """Hold who has tried lately, and who tries before somebody arms."""
        self._held.hold(now_s, EMERGENCY_STOP)
        self._estopped = True

    def arm(self, session: Session) -> None:
        """No e-stop is latched any more; this client knows of the stop, and asks to drive."""
        self._estopped = False
        self._held.free(self._of(session))

    def _of(self, session: Session) -> list[str]:
        return [source for source, last in self._last.items() if last is session]
