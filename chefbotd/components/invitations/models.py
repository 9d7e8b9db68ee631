"""What is asked and answered about invitations."""

from typing import ClassVar, Literal

from pydantic import Field, SecretStr

from chefbotd.core.record import Record
from chefbotd.rpc.models import Params
from chefbotd.rpc.parameters import Role


class MakeInvitationParams(Params):
    """Whom to let in, for how long, and how long the invitation is open."""

    role: Role = Field(Role.GUEST, strict=False, description="what the phone may do")
    access_s: float | None = Field(
        None, ge=60.0, le=31_622_400.0, description="how long its access lasts; null: until it is revoked"
    )
    lifetime_s: float = Field(300.0, ge=10.0, le=86_400.0, description="how long the invitation can be used")
    approval: bool = Field(False, description="whether somebody must approve the phone")
    name: str = Field("", max_length=64, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$", description="whom it is for")


class RedeemInvitationParams(Params):
    """The secret of the link, the code, or the ticket of a phone that waits for approval."""

    confidential: ClassVar[bool] = True

    secret: SecretStr = Field(min_length=1, max_length=128)
    device: str = Field("a phone", min_length=1, max_length=64, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")


class InvitationParams(Params):
    """An invitation by its number."""

    invitation: int = Field(ge=1)


class RevokeAccessParams(Params):
    """An invitation or somebody who was let in; one of both."""

    invitation: int | None = Field(None, ge=1)
    device: int | None = Field(None, ge=1)


class InvitationMade(Record, frozen=True):
    """An invitation: its link, its code, and the rows of the link's QR code (``1`` is dark)."""

    invitation: int
    role: Role
    link: str
    code: str
    qr: tuple[str, ...]
    lifetime_s: float
    code_lifetime_s: float
    on_this_computer_only: bool


class InvitationRedeemed(Record, frozen=True):
    """``admitted``: the token to keep; ``waiting``: the ticket with which to ask again."""

    state: Literal["admitted", "waiting"]
    role: Role
    token: str = ""
    ticket: str = ""


class OpenInvitation(Record, frozen=True):
    """An invitation that is open; ``device`` is the phone that waits for approval."""

    invitation: int
    role: Role
    name: str
    made_by: str
    expires_in_s: float
    approval: bool
    device: str


class AdmittedDevice(Record, frozen=True):
    """Somebody who was let in; ``expires_s`` is in seconds since 1970, null: it does not expire."""

    device: int
    role: Role
    name: str
    admitted_s: float
    expires_s: float | None


class AccessOverview(Record, frozen=True):
    """The open invitations, and those who were let in."""

    invitations: tuple[OpenInvitation, ...]
    devices: tuple[AdmittedDevice, ...]
