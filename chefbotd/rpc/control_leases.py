"""Who drives: a lease on each source of commands, taken by driving and taken over only explicitly.

A lease ends with its client, when it is given back, or ``lease_s`` after its last drive. When it ends with its client
or is taken over, the source's last command is withdrawn: nobody answers for it any more.

A stop holds the source of every other client that drives: it is refused until it has let go, which is to say nothing
for ``let_go_s``, or to give its sources back, or asks anew with ``arm``. Who repeats a command in ignorance of the
stop would undo it otherwise. The client that has stopped the robot knows, and is not held.
"""

from collections.abc import Callable
from dataclasses import dataclass

from chefbotd.core.events import ControlChanged
from chefbotd.rpc.jsonrpc import ErrorKind
from chefbotd.rpc.method import Unserved
from chefbotd.rpc.session import Session


@dataclass(slots=True)
class Lease:
    """Whose a source is, and since when it has not tried to drive; one lasts for as long as it does.

    ``stopped_by`` names whose stop holds it, empty where none does.
    """

    holder: Session
    stamp_s: float
    stopped_by: str = ""


class ControlLeases:
    """The leases by source; ``withdraw`` forgets a source's command, ``announce`` tells who drives."""

    def __init__(
        self,
        lease_s: float,
        let_go_s: float,
        withdraw: Callable[[str], None],
        announce: Callable[[ControlChanged], None],
    ) -> None:
        self._lease_s, self._let_go_s = lease_s, let_go_s
        self._withdraw, self._announce = withdraw, announce
        self._leases: dict[str, Lease] = {}

    def holder(self, source: str, now_s: float) -> Session | None:
        """Whose a source is."""
        lease = self._leases.get(source)
        if lease is None:
            return None
        lasts_s = max(self._lease_s, self._let_go_s) if lease.stopped_by else self._lease_s
        return lease.holder if now_s - lease.stamp_s <= lasts_s else None

    def has(self, session: Session) -> bool:
        """Whether a client has control of a source."""
        return any(lease.holder is session for lease in self._leases.values())

    def require(self, source: str, session: Session, now_s: float) -> None:
        """Raise ``Unserved`` when the source is another client's, or held by another client's stop."""
        holder = self.holder(source, now_s)
        if holder is not None and holder is not session:
            raise Unserved(
                ErrorKind.LEASE_HELD,
                f"{source} is driven by {holder}; take_control takes it over",
                {"source": source, "holder": str(holder)},
            )
        if holder is not None:
            self._require_let_go(source, self._leases[source], now_s)

    def _require_let_go(self, source: str, lease: Lease, now_s: float) -> None:
        if not lease.stopped_by:
            return
        has_let_go, lease.stamp_s = self._has_let_go(lease, now_s), now_s
        if has_let_go:
            lease.stopped_by = ""
            return
        raise Unserved(
            ErrorKind.STOPPED,
            f"{source} was stopped by {lease.stopped_by}: do not drive for {self._let_go_s:g} s, or send arm",
            {"source": source, "stopped_by": lease.stopped_by, "let_go_s": self._let_go_s},
        )

    def drivers(self, now_s: float) -> dict[str, str]:
        """Who drives, by source; who has let go does not."""
        return {
            s: str(lease.holder) for s, lease in self._leases.items() if not self._has_let_go(lease, now_s)
        }

    def hold(self, session: Session, now_s: float) -> None:
        """A client has stopped the robot: refuse the other drivers until they have let go."""
        for lease in self._leases.values():
            if lease.holder is not session and not self._has_let_go(lease, now_s):
                lease.stopped_by = str(session)

    def _has_let_go(self, lease: Lease, now_s: float) -> bool:
        return now_s - lease.stamp_s >= self._let_go_s

    def resume(self, session: Session) -> None:
        """A client that was held asks anew."""
        for lease in self._leases.values():
            if lease.holder is session:
                lease.stopped_by = ""

    def renew(self, source: str, session: Session, now_s: float) -> None:
        """The client has driven: the source is its own from now on."""
        lease = self._leases.get(source)
        if lease is not None and lease.holder is session:
            lease.stamp_s = now_s
        else:
            self._leases[source] = Lease(session, now_s)
            self._tell(now_s)

    def take(self, source: str, session: Session, now_s: float) -> Session | None:
        """Give a source to a client, whoever has it; who had it until now."""
        before = self.holder(source, now_s)
        if before is not None and before is not session:
            self._withdraw(source)
        self.renew(source, session, now_s)
        return before

    def release(self, session: Session, now_s: float) -> list[str]:
        """End all leases of a client, and withdraw its commands; the sources that it had."""
        sources = [source for source, lease in self._leases.items() if lease.holder is session]
        for source in sources:
            del self._leases[source]
            self._withdraw(source)
        if sources:
            self._tell(now_s)
        return sources

    def forget(self) -> None:
        """End every lease and withdraw nothing: the daemon is ending, and stops the robot itself."""
        self._leases.clear()

    def expire(self, now_s: float) -> None:
        """Forget the leases that have ended with time."""
        over = [source for source in self._leases if self.holder(source, now_s) is None]
        for source in over:
            del self._leases[source]
        if over:
            self._tell(now_s)

    def renamed(self, session: Session, now_s: float) -> None:
        """A client goes by another name now."""
        if any(lease.holder is session for lease in self._leases.values()):
            self._tell(now_s)

    def _tell(self, now_s: float) -> None:
        self._announce(ControlChanged(now_s, {s: str(lease.holder) for s, lease in self._leases.items()}))
