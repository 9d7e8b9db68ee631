"""What the component for discovery offers to the daemon."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, Extra

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.discovery.parameters import DiscoveryParameters
    from chefbotd.features.feature import Feature
    from chefbotd.settings import Settings


def build(context: "Context[DiscoveryParameters]") -> "Feature":
    """Announces the socket and the page."""
    from chefbotd.components.discovery.service import discovery

    parts = context.parts
    encrypted = context.settings.api.tls_certificate is not None
    return discovery(context.section, context.robot_name, parts.socket, parts.page, encrypted=encrypted)


def page_hosts(section: "DiscoveryParameters", settings: "Settings") -> tuple[str, ...]:
    """The name on the network, under which browsers may open the page."""
    return (f"{section.label(settings.robot.name)}.local".lower(),)


COMPONENT = Component(
    name="discovery",
    api=API_VERSION,
    section="chefbotd.components.discovery.parameters:DiscoveryParameters",
    build=build,
    is_enabled=lambda section, settings: section.enabled,
    extra=Extra("discovery", ("zeroconf", "ifaddr")),
    outward=True,
    page_hosts=page_hosts,
)
