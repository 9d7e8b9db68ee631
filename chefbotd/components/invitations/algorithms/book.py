"""The invitations that are open: each is used once, by its link or its code, before it expires."""

import hashlib
from collections.abc import Callable

from chefbotd.core.record import Record, replace
from chefbotd.rpc.parameters import Role

CODE_LETTERS = "ABCDEFGHJKMNPQRSTVWXYZ23456789"
"""Without those that are read as another: I, L, O, U, 0 and 1."""

CODE_LENGTH = 8
"""30 ** 8 codes: 39 bits, which the limit on attempts and ``CODE_LIFETIME_S`` protect."""

CODE_LIFETIME_S = 300.0
SECRET_BYTES = 16
MOST_OPEN = 64
MOST_ADDRESSES = 1024

ATTEMPTS, ATTEMPT_EVERY_S = 5, 10.0
"""A computer may try five codes at once, then one every ten seconds."""

ALL_ATTEMPTS, ALL_EVERY_S = 30, 1.0
"""All computers together."""


class Invitation(Record, frozen=True):
    """One that was made. ``device`` is what the phone calls itself, once it has come; ``ticket`` is what it then shows.

    ``access_s`` is how long its access lasts, None: until it is revoked. One that needs ``approval`` waits for it from
    the moment at which a phone has come.
    """

    number: int
    role: Role
    name: str
    made_by: str
    secret: bytes
    code: bytes
    made_s: float
    expires_s: float
    access_s: float | None
    approval: bool
    device: str = ""
    ticket: bytes = b""
    approved: bool = False

    @property
    def used(self) -> bool:
        """Whether a phone has come with it."""
        return bool(self.ticket)


class TooManyAttempts(Exception):
    """Codes were tried faster than anybody types them."""


class NotOpen(Exception):
    """There is no such invitation any more, or there never was."""


class TooManyOpen(Exception):
    """As many invitations are open as may be."""


class Attempts:
    """Counts attempts: ``most`` at once, then one in ``every_s``."""

    def __init__(self, most: int, every_s: float) -> None:
        self._most, self._every_s, self._spent, self._stamp_s = most, every_s, 0.0, 0.0

    def spent(self, now_s: float) -> float:
        """How many count now."""
        self._spent = max(0.0, self._spent - (now_s - self._stamp_s) / self._every_s)
        self._stamp_s = now_s
        return self._spent

    def take_attempt(self, now_s: float) -> bool:
        """Whether there may be another one."""
        if self.spent(now_s) > self._most - 1:
            return False
        self._spent += 1.0
        return True


def digest(secret: str) -> bytes:
    """What is kept of a secret."""
    return hashlib.sha256(secret.encode(errors="surrogatepass")).digest()


def is_code(text: str) -> bool:
    """Whether this was typed as a code."""
    return len(normalize_code(text)) == CODE_LENGTH


def normalize_code(text: str) -> str:
    """A code as it was made: capitals, without what people put between letters."""
    return "".join(text.upper().replace("-", " ").split())


def make_code(choose: Callable[[str], str]) -> str:
    """A code of letters that ``choose`` draws, in two groups."""
    letters = "".join(choose(CODE_LETTERS) for _ in range(CODE_LENGTH))
    return f"{letters[:4]}-{letters[4:]}"


class InvitationBook:
    """Remembers open invitations in memory alone: the end of the daemon voids them."""

    def __init__(self) -> None:
        self._open: dict[int, Invitation] = {}
        self._count = 0
        self._all = Attempts(ALL_ATTEMPTS, ALL_EVERY_S)
        self._by_host: dict[str, Attempts] = {}

    def add(
        self,
        role: Role,
        secret: str,
        code: str,
        now_s: float,
        *,
        lifetime_s: float,
        access_s: float | None,
        approval: bool,
        name: str,
        made_by: str,
    ) -> Invitation:
        """Open an invitation.

        Raises:
            TooManyOpen: there are ``MOST_OPEN``.
        """
        self.forget_expired(now_s)
        if len(self._open) >= MOST_OPEN:
            raise TooManyOpen
        self._count += 1
        made = Invitation(
            self._count,
            role,
            name,
            made_by,
            digest(secret),
            digest(normalize_code(code)),
            now_s,
            now_s + lifetime_s,
            access_s,
            approval,
        )
        self._open[made.number] = made
        return made

    def invitations(self, now_s: float) -> list[Invitation]:
        """Those that are open, the oldest first."""
        self.forget_expired(now_s)
        return list(self._open.values())

    def find(self, secret: str, host: str, now_s: float) -> Invitation:
        """The invitation with this link's secret, this code, or the ticket that a phone got for it.

        Raises:
            TooManyAttempts: codes were tried too fast from there, or by all.
            NotOpen: there is none.
        """
        self.forget_expired(now_s)
        typed = is_code(secret)
        if typed:
            self._count_attempt(host, now_s)
        offered = digest(normalize_code(secret) if typed else secret)
        for invitation in self._open.values():
            if offered == invitation.ticket or (
                not invitation.used and self._opens(invitation, offered, now_s, typed=typed)
            ):
                return invitation
        raise NotOpen

    def _opens(self, invitation: Invitation, offered: bytes, now_s: float, *, typed: bool) -> bool:
        return (
            invitation.made_s + CODE_LIFETIME_S > now_s and offered == invitation.code
            if typed
            else offered == invitation.secret
        )

    def use(self, number: int, device: str, ticket: str) -> Invitation:
        """A phone has come: from now on only its ticket finds the invitation."""
        return self._keep_open(replace(self._open[number], device=device, ticket=digest(ticket)))

    def approve(self, number: int) -> Invitation:
        """Let the phone in that has come.

        Raises:
            NotOpen: no phone waits with this invitation.
        """
        invitation = self._open.get(number)
        if invitation is None or not invitation.used:
            raise NotOpen
        return self._keep_open(replace(invitation, approved=True))

    def put_back(self, invitation: Invitation) -> None:
        """Open one again that was taken and gave no access."""
        self._keep_open(invitation)

    def close_invitation(self, number: int) -> Invitation | None:
        """Close an invitation, which is returned; None: it is not open."""
        return self._open.pop(number, None)

    def _keep_open(self, invitation: Invitation) -> Invitation:
        self._open[invitation.number] = invitation
        return invitation

    def forget_expired(self, now_s: float) -> None:
        """Close what has expired."""
        self._open = {
            number: invitation for number, invitation in self._open.items() if invitation.expires_s > now_s
        }

    def _count_attempt(self, host: str, now_s: float) -> None:
        self._by_host = {
            address: attempts for address, attempts in self._by_host.items() if attempts.spent(now_s) > 0.0
        }
        if host not in self._by_host and len(self._by_host) >= MOST_ADDRESSES:
            raise TooManyAttempts
        attempts = self._by_host.setdefault(host, Attempts(ATTEMPTS, ATTEMPT_EVERY_S))
        if not attempts.take_attempt(now_s) or not self._all.take_attempt(now_s):
            raise TooManyAttempts
