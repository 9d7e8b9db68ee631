"""Control of the sources: a lease on each, taken by driving, and taken over only on request.

A lease ends with its client, when it is given back, or ``lease_s`` after its last attempt to drive. When it ends with
its client or is taken over, the source's last command is withdrawn: nobody answers for it any more.
"""

from collections.abc import Callable
from typing import Protocol

from msgspec import Struct

from chefbotd.core.events import ControlChanged
from chefbotd.core.record import MutableState, StatefulPart
from chefbotd.core.sentence import Sentence
from chefbotd.rpc.jsonrpc import ErrorKind
from chefbotd.rpc.method import Unserved
from chefbotd.rpc.session import Session, SessionState


class TakeOver(Protocol):
    """Is told that a client takes control of a source."""

    def __call__(self, client: int, source: str, *, from_another: bool) -> None:
        """``from_another``: another client had it until now."""
        ...


class Sources(Struct, frozen=True):
    """The sources of velocity commands; ``take_over`` is told of each client, by its number, that takes control."""

    names: tuple[str, ...]
    default: str
    take_over: TakeOver


class Lease(MutableState, array_like=True):
    """Whose a source is, by the client's number, and when it last tried to drive."""

    holder: int
    stamp_s: float


class LeasesState(MutableState):
    """The clients that have a source, and the leases by source. The robot's own drivers are counted down from -1."""

    clients: list[SessionState] = []
    leases: dict[str, Lease] = {}


class ControlLeases(StatefulPart[LeasesState]):
    """The leases by source; ``withdraw`` forgets a source's command, ``announce`` tells who drives."""

    def __init__(
        self,
        lease_s: float,
        stop_hold_s: float,
        withdraw: Callable[[str], None],
        announce: Callable[[ControlChanged], None],
    ) -> None:
        self._lease_s, self.stop_hold_s = lease_s, stop_hold_s
        self._withdraw, self._announce = withdraw, announce
        self.memory = LeasesState()
        self._own: dict[int, Session] = {}
        self._holders: dict[int, Session] = {}

    def add_own(self, session: Session) -> None:
        """A driver inside the daemon is to have leases, too."""
        self._own[-1 - len(self._own)] = session

    def state(self) -> LeasesState:
        """Return the state of this part."""
        self.memory.clients = [
            holder.state() for number, holder in self._holders.items() if number not in self._own
        ]
        return self.memory

    def restore(self, state: LeasesState) -> None:
        """Restore this state; raises ``KeyError`` for a number without a client."""
        sessions = self._own | {client.number: Session.restored(client) for client in state.clients}
        self._holders = {lease.holder: sessions[lease.holder] for lease in state.leases.values()}
        super().restore(state)

    def holder(self, source: str, now_s: float) -> Session | None:
        """Whose a source is."""
        lease = self.memory.leases.get(source)
        if lease is None or now_s - lease.stamp_s > self._lease_s:
            return None
        return self._holders[lease.holder]

    @property
    def any_held(self) -> bool:
        """Whether a lease can expire."""
        return bool(self.memory.leases)

    def has(self, session: Session) -> bool:
        """Whether a client has control of a source."""
        return any(holder is session for holder in self._holders.values())

    def sessions(self) -> list[Session]:
        """Every client that has a source."""
        return list(self._holders.values())

    def require(self, source: str, session: Session, now_s: float) -> None:
        """Let a client drive a source; raises ``Unserved`` when another client has control of it."""
        holder = self.holder(source, now_s)
        if holder is not None and holder is not session:
            raise Unserved(
                ErrorKind.LEASE_HELD,
                Sentence(
                    "driving.controlled_by",
                    "{source} is controlled by {holder}; take control to drive",
                    source=source,
                    holder=holder,
                ),
                {"source": source, "holder": str(holder)},
            )
        if holder is not None:
            self.memory.leases[source].stamp_s = now_s

    def drivers(self, now_s: float) -> dict[str, str]:
        """The client that drives each source; a client that let go drives none."""
        return {
            source: str(self._holders[lease.holder])
            for source, lease in self.memory.leases.items()
            if now_s - lease.stamp_s < self.stop_hold_s
        }

    def renew(self, source: str, session: Session, now_s: float) -> None:
        """The client has driven: the source is its own from now on."""
        lease = self.memory.leases.get(source)
        if lease is not None and self._holders[lease.holder] is session:
            lease.stamp_s = now_s
        else:
            number = next((own for own, driver in self._own.items() if driver is session), session.number)
            self._holders[number] = session
            self.memory.leases[source] = Lease(number, now_s)
            self._announce_control(now_s)

    def take_source(self, source: str, session: Session, now_s: float) -> Session | None:
        """Give a source to a client. Returns the client that had it."""
        before = self.holder(source, now_s)
        if before is not None and before is not session:
            self._withdraw(source)
        self.renew(source, session, now_s)
        return before

    def release(self, session: Session, now_s: float) -> list[str]:
        """End all leases of a client, and withdraw its commands; the sources that it had."""
        leases = self.memory.leases
        sources = [source for source, lease in leases.items() if self._holders[lease.holder] is session]
        for source in sources:
            del leases[source]
            self._withdraw(source)
        if sources:
            self._announce_control(now_s)
        return sources

    def forget(self) -> None:
        """End every lease and withdraw nothing: the daemon is ending, and stops the robot itself."""
        self.memory.leases.clear()
        self._holders.clear()

    def expire(self, now_s: float) -> None:
        """Forget the leases that have ended with time."""
        over = [source for source in self.memory.leases if self.holder(source, now_s) is None]
        for source in over:
            del self.memory.leases[source]
        if over:
            self._announce_control(now_s)

    def renamed(self, session: Session, now_s: float) -> None:
        """A client goes by another name now."""
        if self.has(session):
            self._announce_control(now_s)

    def _announce_control(self, now_s: float) -> None:
        """Tell who has each source, and keep no other client."""
        leases = self.memory.leases.items()
        self._holders = {lease.holder: self._holders[lease.holder] for _, lease in leases}
        holders = {source: str(self._holders[lease.holder]) for source, lease in leases}
        self._announce(ControlChanged(now_s, holders))
