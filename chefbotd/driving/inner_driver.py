"""A driver inside the daemon, such as navigation. Its commands go through the same gate as a client's.

The source has a lease, the dead-man ends each command, limits and guards hold, and a higher source takes over at once.
"""

from collections.abc import Collection
from typing import Final, Protocol

from chefbotd.clock import Clock
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import Motion, WheelDuties
from chefbotd.core.record import StatefulValue
from chefbotd.core.sentence import Sentence
from chefbotd.rpc.control_leases import ControlLeases
from chefbotd.rpc.method import Unserved
from chefbotd.rpc.parameters import ApiParameters, Role
from chefbotd.rpc.session import Session

MOST_AGE_S: Final = 0.3
"""Older requests are not driven: a delayed worker must not drive by what it saw before."""


class Gate(Protocol):
    """The receiver of commands (``features.driving.service.DriveService``)."""

    @property
    def stops(self) -> int:
        """How many stops and emergency stops there have been."""
        ...

    @property
    def stopped_by(self) -> str:
        """Whose was the last of them."""
        ...

    @property
    def stop_number(self) -> int:
        """Changes with every stop, emergency stop and fault."""
        ...

    def command(self, source: str, motion: Motion | WheelDuties, client: int = 0) -> None:
        """Take a client's command; raises ``Refused``."""
        ...

    def release(self, source: str) -> None:
        """Forget the source's command."""
        ...

    def acknowledge_stops(self, client: int, source: str | None = None) -> None:
        """A client knows of the stops so far, and asks to drive this source (None: any)."""
        ...

    def record_attempt(self, source: str, client: int) -> None:
        """A client tries to drive what another one has."""
        ...


class InnerDriver(StatefulValue[bool]):
    """Drives as one source. The topic ``safety`` names it, under the source's name, as the source's driver.

    ``higher`` are the sources that take over from it. Its ``memory`` is whether it drives.
    """

    def __init__(
        self,
        gate: Gate,
        leases: ControlLeases,
        clock: Clock,
        source: str,
        higher: Collection[str] = (),
    ) -> None:
        self._gate, self._leases, self._clock, self.source = gate, leases, clock, source
        self._higher = frozenset(higher)
        self._session = _Inner(source, clock.now_s())
        self.memory = False
        leases.add_own(self._session)

    def drive(self, motion: Motion | WheelDuties, wished_s: float) -> None:
        """Move like this until the next request, or until the dead-man ends it; ``wished_s`` is the request's time.

        A request that is too old moves nothing.

        Raises:
            Unserved: a client has the source.
            Refused: a stop holds it, or the robot is not armed.
        """
        now_s = self._clock.now_s()
        if now_s - wished_s > MOST_AGE_S:
            return
        try:
            self._leases.require(self.source, self._session, now_s)
        except Unserved:
            self._gate.record_attempt(self.source, self._session.number)
            raise
        self._gate.command(self.source, motion, self._session.number)
        self._leases.renew(self.source, self._session, now_s)
        self.memory = True

    @property
    def stops(self) -> int:
        """The number of stops so far. Requests from before the last one are void."""
        return self._gate.stops

    @property
    def stopped_by(self) -> str:
        """Whose was the last of them."""
        return self._gate.stopped_by

    @property
    def stop_number(self) -> int:
        """Changes with every stop, e-stop and fault: to be read when a request arrives, for ``begin``."""
        return self._gate.stop_number

    def require_unstopped(self, stop_number: int, what: str) -> None:
        """Let begin what has waited since this was the number; ``what`` says so, as "this goal was sent".

        Raises:
            Refused: the robot was stopped or had a fault meanwhile, also where it is armed again.
        """
        if self.stop_number != stop_number:
            raise Refused(
                RefusalKind.STOPPED,
                Sentence(
                    "driving.stopped_after",
                    "the robot was stopped after {what}; ask again if it is still wanted",
                    what=what,
                ),
            )

    def gives_way_to(self, source: str | None) -> bool:
        """Whether this source is a higher one; while a higher one is in force, this driver is not followed."""
        return source in self._higher

    def begin(self, stop_number: int, what: str) -> None:
        """Let begin what was asked for at this stop number: earlier stops do not hold it.

        Raises:
            Refused: as ``require_unstopped``.
        """
        self.require_unstopped(stop_number, what)
        self._gate.acknowledge_stops(self._session.number, self.source)

    def let_go(self) -> None:
        """Release the source: the robot comes to rest, or a lower source drives."""
        if self.memory:
            self.memory = False
            self._leases.release(self._session, self._clock.now_s())


class _Inner(Session):
    """The number of no connection."""

    def __init__(self, source: str, now_s: float) -> None:
        super().__init__(ApiParameters(), "", 0, Role.DRIVE, now_s)
        self._source = source

    def __str__(self) -> str:
        return f"the robot's own {self._source}"
