"""What the component for recordings offers."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, Extra, PagePart, RunOption, StatusRow

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.recording.parameters import RecordingParameters
    from chefbotd.features.feature import Feature
    from chefbotd.settings import Settings

EVENTS = "chefbotd/core/events"
"""The page that lists the names of events."""


def build(context: "Context[RecordingParameters]") -> "list[Feature]":
    """Records, in a process of its own or with the writer of a test."""
    if context.substitute is None and not context.parts.context.own_process:
        return []
    from chefbotd.components.recording.build import recorder_of, writer_of

    start = context.substitute or writer_of(context.section)
    return [] if start is None else [recorder_of(context, start)]


def check(section: "RecordingParameters", settings: "Settings") -> Iterator[str]:
    """Every class of events that is not to be recorded is one."""
    if section.exclude:
        from chefbotd.event_classes import event_names  # every class of events

        every_name = event_names() | strangers_events(settings)
        for name in sorted(section.exclude - every_name):
            yield f"recording.exclude: there is no class of events {name!r}; they are in {EVENTS}"


def strangers_events(settings: "Settings") -> frozenset[str]:
    """The names of the events of strangers' components."""
    components = [stranger.component for stranger in settings.strangers if stranger.component is not None]
    named = [event for component in components for event in component.events]
    return frozenset(
        event.rpartition(":")[2] if isinstance(event, str) else event.__name__ for event in named
    )


COMPONENT = Component(
    name="recording",
    api=API_VERSION,
    section="chefbotd.components.recording.parameters:RecordingParameters",
    build=build,
    is_enabled=lambda section, settings: section.enabled,
    # what keeps only the last minutes runs without
    extra=Extra("recording", ("mcap", "zstandard", "lz4"), when=lambda section: section.auto_start),
    paths=("folder",),
    outward=True,
    fixed=True,
    check=check,
    commands={
        "record": "chefbotd.components.recording.cli.commands:record",
        "log": "chefbotd.components.recording.cli.commands:log_group",
    },
    run_options=(
        RunOption(
            "--record",
            "Record from the start on, so that 'replay' can repeat it, as [recording] auto_start = true does.",
            lambda given: {"recording.enabled": True, "recording.auto_start": True},
        ),
    ),
    daemon_commands={"replay": "chefbotd.components.recording.cli.replay:replay"},
    page=(PagePart("chefbotd.components.recording", "card.js", order=20),),
    status=(StatusRow("recording", "chefbotd.components.recording.status_text:recording", after="worker"),),
)
