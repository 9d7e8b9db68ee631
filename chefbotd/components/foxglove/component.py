"""What the component for Foxglove offers to the daemon."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, Extra, RunOption

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.foxglove.parameters import FoxgloveParameters
    from chefbotd.features.feature import Feature


def build(context: "Context[FoxgloveParameters]") -> "Feature":
    """Serves Foxglove."""
    from chefbotd.components.foxglove.service import foxglove

    scanner = context.settings.first_scanner
    return foxglove(context.bus, context.clock, context.section, context.robot_name, scanner)


COMPONENT = Component(
    name="foxglove",
    api=API_VERSION,
    section="chefbotd.components.foxglove.parameters:FoxgloveParameters",
    build=build,
    is_enabled=lambda section, settings: section.enabled,
    extra=Extra("foxglove", ("foxglove",)),
    outward=True,
    run_options=(
        RunOption(
            "--foxglove",
            "Serve Foxglove, as [foxglove] enabled = true does.",
            lambda given: {"foxglove.enabled": True},
        ),
    ),
)
