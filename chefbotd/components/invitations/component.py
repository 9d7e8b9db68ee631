"""What the component for invitations offers to the daemon."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, Extra, PagePart

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.invitations.parameters import InvitationsParameters
    from chefbotd.features.feature import Feature


def build(context: "Context[InvitationsParameters]") -> "Feature":
    """Invites phones, and keeps who was let in."""
    from chefbotd.components.invitations.build import invitations_of

    return invitations_of(context)


COMPONENT = Component(
    name="invitations",
    api=API_VERSION,
    section="chefbotd.components.invitations.parameters:InvitationsParameters",
    build=build,
    is_enabled=lambda section, settings: section.enabled,
    extra=Extra("page", ("segno",)),
    paths=("folder",),
    outward=True,
    exclusive=True,
    page=(PagePart("chefbotd.components.invitations", "card.js", panel="people"),),
    commands={
        "invite": "chefbotd.components.invitations.cli:invite",
        "guests": "chefbotd.components.invitations.cli:guests",
        "token": "chefbotd.components.invitations.token_file:token",
    },
)
