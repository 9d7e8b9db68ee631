"""The section [invitations]."""

from pathlib import Path

from pydantic import Field

from chefbotd.core.parameters import Parameters


class InvitationsParameters(Parameters):
    """How phones are invited; it needs tokens (``api.token_file`` or ``api.token_credential``)."""

    enabled: bool = False
    """Administrators may let phones in by a QR code."""
    folder: Path | None = Field(
        None,
        description="Where it is kept who was let in; left out: the folder for state of this user or service",
    )
    address: str | None = Field(
        None,
        pattern=r"^https?://[^\s#]+$",
        description="The page's address as phones reach it, such as https://robot.example/; left out: the computer's",
    )
