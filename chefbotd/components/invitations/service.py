"""Carries out what is asked about invitations: makes them, lets phones in by them, and revokes both."""

import asyncio
import secrets
from collections.abc import Awaitable, Callable, Mapping
from typing import Final, Protocol

import structlog

from chefbotd.clock import Clock
from chefbotd.components.invitations import models
from chefbotd.components.invitations.access_file import (
    MOST_DEVICES,
    AccessFile,
    AccessList,
    Device,
    UnreadableAccess,
)
from chefbotd.components.invitations.algorithms.book import (
    CODE_LIFETIME_S,
    MOST_OPEN,
    SECRET_BYTES,
    Invitation,
    InvitationBook,
    NotOpen,
    TooManyAttempts,
    TooManyOpen,
    digest,
    make_code,
)
from chefbotd.components.invitations.qr import qr_rows
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.record import replace
from chefbotd.core.sentence import Sentence
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.method import Caller, method
from chefbotd.rpc.models import DONE, Done, NoParams
from chefbotd.rpc.parameters import Role
from chefbotd.storage import explain

log = structlog.get_logger(component="invitations")

EXPIRY_S: Final = 5.0
"""How often it is looked whether somebody's access has expired."""

APPROVAL_S: Final = 600.0
"""How long a phone that has come may wait for its approval, also where the invitation would end before."""

CLOSED = Sentence(
    "invitations.closed",
    "this invitation is not open: it was used, revoked or has expired; ask for a new one",
)


class Tokens(Protocol):
    """What opens the socket."""

    @property
    def asks_for_tokens(self) -> bool:
        """Whether a client has to show a token."""
        ...

    def set_issued_tokens(self, roles: Mapping[bytes, Role]) -> None:
        """Let these open the socket too, by their digests; a client whose token is gone is disconnected."""
        ...


class Invitations:
    """``tokens`` is asked for when the server runs. ``wall_s`` is the time since 1970, ``link_base`` the page's address.

    ``link_base`` also says whether only this computer reaches it. ``encrypted``: the page speaks TLS.
    """

    def __init__(
        self,
        clock: Clock,
        wall_s: Callable[[], float],
        file: AccessFile,
        tokens: Callable[[], Tokens],
        link_base: Callable[[], Awaitable[tuple[str, bool]]],
        *,
        encrypted: bool,
    ) -> None:
        self._clock, self._wall_s, self._file, self._tokens = clock, wall_s, file, tokens
        self._link_base, self._encrypted = link_base, encrypted
        self._book, self._order = InvitationBook(), asyncio.Lock()
        self._access_list: AccessList | None = None
        self._unreadable = "who was let in is being read"
        self._known_s, self._known_at_s = 0.0, clock.now_s()
        self._is_kept = True

    async def run(self) -> None:
        """Let in those who were let in before, and end what expires."""
        try:
            self._access_list = await asyncio.to_thread(self._file.read)
            self._unreadable = ""
        except (OSError, UnreadableAccess) as error:
            self._unreadable = explain(error) if isinstance(error, OSError) else str(error)
            log.error("nobody who was invited can come in", reason=self._unreadable)
        self._known_s = max([self._time_s(), *(device.admitted_s for device in self._devices())])
        valid: list[Device] = []
        while True:
            now_s = self._time_s()
            now = [device for device in self._devices() if device.is_valid(now_s)]
            if now != valid:
                valid = now
                self._issue()
            if len(now) < len(self._devices()):
                await self._forget_expired()
            self._book.forget_expired(self._clock.now_s())
            await asyncio.sleep(EXPIRY_S)

    def _time_s(self) -> float:
        """The time since 1970. It never goes back, as access that has ended would begin again.

        A computer without a battery for its clock starts in the past, and a clock is set right, or wrong.
        """
        now_s = self._clock.now_s()
        self._known_s = max(self._wall_s(), self._known_s + now_s - self._known_at_s)
        self._known_at_s = now_s
        return self._known_s

    async def _forget_expired(self) -> None:
        """Access that has ended is gone for good, whatever the clock says after the next start."""

        def forget(access_list: AccessList) -> AccessList:
            now_s = self._time_s()
            valid = tuple(device for device in access_list.devices if device.is_valid(now_s))
            return replace(access_list, devices=valid)

        try:
            await self._change(forget)
            self._is_kept = True
        except Refused as refused:  # it is tried again, and opens nothing meanwhile
            if self._is_kept:
                log.warning("access that has ended is still in the file", reason=str(refused))
            self._is_kept = False

    def _devices(self) -> tuple[Device, ...]:
        return () if self._access_list is None else self._access_list.devices

    def _issue(self) -> None:
        tokens = self._tokens()
        if tokens.asks_for_tokens:
            now_s = self._time_s()
            tokens.set_issued_tokens(
                {device.digest: device.role for device in self._devices() if device.is_valid(now_s)}
            )

    @method(role=Role.ADMIN, moves=False)
    async def make_invitation(
        self, caller: Caller, params: models.MakeInvitationParams, progress: ProgressReporter
    ) -> models.InvitationMade:
        """Make an invitation, which lets one phone in: a link, its QR code, and a short code to type."""
        if not self._tokens().asks_for_tokens:
            raise Refused(
                RefusalKind.CANNOT_INVITE,
                Sentence(
                    "invitations.no_tokens",
                    "this robot asks nobody who they are, so nobody needs an invitation: configure its token file first",
                ),
            )
        if params.role is Role.ADMIN and not self._encrypted:
            raise Refused(
                RefusalKind.CANNOT_INVITE,
                Sentence(
                    "invitations.needs_tls",
                    "an administrator is invited only over TLS, as others in the network could read the token: "
                    "configure a certificate and its key first",
                ),
            )
        base, is_local = await self._link_base()
        secret, code = secrets.token_urlsafe(SECRET_BYTES), make_code(secrets.choice)
        try:
            made = self._book.add(
                params.role,
                secret,
                code,
                self._clock.now_s(),
                lifetime_s=params.lifetime_s,
                access_s=params.access_s,
                approval=params.approval,
                name=params.name,
                made_by=str(caller.session),
            )
        except TooManyOpen:
            raise Refused(
                RefusalKind.CANNOT_INVITE,
                Sentence(
                    "invitations.too_many_open",
                    "{most} invitations are open: revoke one first",
                    most=MOST_OPEN,
                ),
            ) from None
        log.info("invitation made", invitation=made.number, role=str(made.role), client=made.made_by)
        link = f"{base}#join={secret}"
        code_s = min(params.lifetime_s, CODE_LIFETIME_S)
        return models.InvitationMade(
            made.number, made.role, link, code, qr_rows(link), params.lifetime_s, code_s, is_local
        )

    @method(role=None)
    async def redeem_invitation(
        self, caller: Caller, params: models.RedeemInvitationParams, progress: ProgressReporter
    ) -> models.InvitationRedeemed:
        """Come in by an invitation; answers the token to keep, or a ticket while somebody has to approve."""
        secret = params.secret.get_secret_value()
        try:
            invitation = self._book.find(secret, caller.session.host, self._clock.now_s())
        except TooManyAttempts:
            raise Refused(
                RefusalKind.TOO_MANY_ATTEMPTS,
                Sentence(
                    "invitations.too_many_codes", "too many codes were tried; wait ten seconds and try again"
                ),
            ) from None
        except NotOpen:
            raise Refused(RefusalKind.NOT_INVITED, CLOSED) from None
        if invitation.approval and not invitation.approved:
            return self._hold_for_approval(invitation, secret, params.device)
        return await self._admit(invitation, params.device)

    def _hold_for_approval(
        self, invitation: Invitation, secret: str, device: str
    ) -> models.InvitationRedeemed:
        if invitation.used:
            return models.InvitationRedeemed("waiting", invitation.role, ticket=secret)
        ticket = secrets.token_urlsafe(SECRET_BYTES)
        used = self._book.use(invitation.number, device, ticket)
        self._book.put_back(replace(used, expires_s=max(used.expires_s, self._clock.now_s() + APPROVAL_S)))
        log.info("a phone waits for approval", invitation=invitation.number, device=device)
        return models.InvitationRedeemed("waiting", invitation.role, ticket=ticket)

    async def _admit(self, invitation: Invitation, device: str) -> models.InvitationRedeemed:
        """Nobody else finds the invitation from here on; it is open again where the disk fails."""
        self._book.close_invitation(invitation.number)
        token, now_s = secrets.token_urlsafe(2 * SECRET_BYTES), self._time_s()
        expires_s = None if invitation.access_s is None else now_s + invitation.access_s
        name = invitation.name or invitation.device or device

        def admit(access_list: AccessList) -> AccessList:
            valid = tuple(device for device in access_list.devices if device.is_valid(now_s))
            if len(valid) >= MOST_DEVICES:
                raise Refused(
                    RefusalKind.CANNOT_INVITE,
                    Sentence(
                        "invitations.too_many_devices",
                        "{most} phones were let in: revoke one first",
                        most=MOST_DEVICES,
                    ),
                )
            number = access_list.count + 1
            new = Device(number, invitation.role, name, digest(token).hex(), now_s, expires_s)
            return replace(access_list, count=number, devices=(*valid, new))

        try:
            await self._change(admit)
        except Refused:
            self._book.put_back(invitation)
            raise
        log.info("a phone was let in", invitation=invitation.number, role=str(invitation.role), device=name)
        return models.InvitationRedeemed("admitted", invitation.role, token=token)

    @method(role=Role.ADMIN, moves=False)
    def approve_invitation(self, caller: Caller, params: models.InvitationParams) -> Done:
        """Let in the phone that waits with this invitation."""
        try:
            self._book.approve(params.invitation)
        except NotOpen:
            raise Refused(
                RefusalKind.NOT_INVITED,
                Sentence(
                    "invitations.nobody_waits",
                    "no phone waits with the invitation {invitation}",
                    invitation=params.invitation,
                ),
            ) from None
        return DONE

    @method(role=Role.ADMIN, moves=False)
    def list_invitations(self, caller: Caller, params: NoParams) -> models.AccessOverview:
        """The open invitations, and those who were let in by one."""
        now_s, wall_s = self._clock.now_s(), self._time_s()
        opened = tuple(
            models.OpenInvitation(
                invitation.number,
                invitation.role,
                invitation.name,
                invitation.made_by,
                invitation.expires_s - now_s,
                invitation.approval,
                invitation.device,
            )
            for invitation in self._book.invitations(now_s)
        )
        devices = tuple(
            models.AdmittedDevice(
                device.number, device.role, device.name, device.admitted_s, device.expires_s
            )
            for device in self._devices()
            if device.is_valid(wall_s)
        )
        return models.AccessOverview(opened, devices)

    @method(role=Role.ADMIN, moves=False)
    async def revoke_access(
        self, caller: Caller, params: models.RevokeAccessParams, progress: ProgressReporter
    ) -> Done:
        """Close an invitation, or end the access of somebody who was let in and disconnect them."""
        if (params.invitation is None) == (params.device is None):
            raise Refused(
                RefusalKind.NOT_INVITED,
                Sentence("invitations.name_one", "name an invitation or a device, one of both"),
            )
        if params.invitation is not None:
            if self._book.close_invitation(params.invitation) is None:
                raise Refused(
                    RefusalKind.NOT_INVITED,
                    Sentence(
                        "invitations.not_open",
                        "no invitation {invitation} is open",
                        invitation=params.invitation,
                    ),
                )
            return DONE

        def revoke(access_list: AccessList) -> AccessList:
            left = tuple(device for device in access_list.devices if device.number != params.device)
            if len(left) == len(access_list.devices):
                raise Refused(
                    RefusalKind.NOT_INVITED,
                    Sentence(
                        "invitations.unknown_device",
                        "nobody was let in with the number {device}",
                        device=params.device,
                    ),
                )
            return replace(access_list, devices=left)

        await self._change(revoke)
        return DONE

    async def _change(self, change: Callable[[AccessList], AccessList]) -> None:
        """Write the list, then act by it; it is not given up half-way, also where its client goes.

        Raises:
            Refused: it cannot be written, and nothing has changed.
        """
        work = asyncio.ensure_future(self._save_change(change))
        try:
            await asyncio.shield(work)
        except asyncio.CancelledError:
            await asyncio.wait([work])
            raise

    async def _save_change(self, change: Callable[[AccessList], AccessList]) -> None:
        async with self._order:
            if self._access_list is None:
                raise Refused(
                    RefusalKind.STORAGE_FAILED,
                    Sentence("invitations.unreadable", "not possible: {why}", why=self._unreadable),
                )
            changed = change(self._access_list)
            try:
                await asyncio.to_thread(self._file.write, changed)
            except OSError as error:
                raise Refused(
                    RefusalKind.STORAGE_FAILED,
                    Sentence(
                        "invitations.not_saved", "who was let in cannot be saved: {why}", why=explain(error)
                    ),
                ) from error
            self._access_list = changed
            self._issue()
