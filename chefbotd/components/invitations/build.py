"""Builds the component of the daemon's parts."""

import os
import socket
import time
from typing import TYPE_CHECKING

from chefbotd.component_context import Context
from chefbotd.components.invitations.access_file import AccessFile
from chefbotd.components.invitations.parameters import InvitationsParameters
from chefbotd.components.invitations.service import Invitations
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.sentence import Sentence
from chefbotd.features.feature import Feature, Service
from chefbotd.rpc.method import methods_of
from chefbotd.rpc.parameters import is_loopback
from chefbotd.storage import state_folder

if TYPE_CHECKING:
    from chefbotd.composition.context import DaemonParts

FILE = "access.json"


def invitations_of(context: Context[InvitationsParameters]) -> Feature:
    """The feature: its methods, and the loop that ends what expires."""
    section, parts = context.section, context.parts
    folder = section.folder or state_folder("invitations", os.environ, simulated=parts.context.simulated)
    encrypted = context.settings.api.tls_certificate is not None

    async def link_base() -> tuple[str, bool]:
        return await page_address(section.address, parts, encrypted=encrypted)

    service = Invitations(
        context.clock,
        time.time,
        AccessFile(folder / FILE),
        parts.tokens,
        link_base,
        encrypted=encrypted or (section.address or "").startswith("https:"),
    )
    return Feature(
        "invitations",
        services=(Service("invitations", service.run),),
        methods=(rows := methods_of(service)),
        not_replayed=tuple(row.name for row in rows),
    )


async def page_address(address: str | None, parts: "DaemonParts", *, encrypted: bool) -> tuple[str, bool]:
    """The address of the page for a link, and whether only this computer reaches it.

    Raises:
        Refused: the page is not served, or the computer is in no network.
    """
    if address is not None:
        return address, False
    if parts.page is None:
        raise Refused(
            RefusalKind.CANNOT_INVITE,
            Sentence(
                "invitations.no_page", "a phone comes in by the page, which is switched off on this robot"
            ),
        )
    host, port = await parts.page()
    if host in ("0.0.0.0", "::"):  # noqa: S104 - it is compared, not listened on
        host = own_address()
    shown = f"[{host}]" if ":" in host else host
    return f"{'https' if encrypted else 'http'}://{shown}:{port}/", is_loopback(host)


def own_address() -> str:
    """This computer's IPv4 address in its network; nothing is sent for that.

    Raises:
        Refused: it is in no network.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(
                ("192.0.2.1", 9)
            )  # an address for documentation (RFC 5737): only the route is looked up
        except OSError as error:
            raise Refused(
                RefusalKind.CANNOT_INVITE,
                Sentence(
                    "invitations.no_network",
                    "this computer is in no network, and no address for links is configured",
                ),
            ) from error
        return str(probe.getsockname()[0])
