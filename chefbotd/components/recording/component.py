"""What the component for recordings offers."""

from chefbotd.component import API_VERSION, Component, StatusRow

COMPONENT = Component(
    name="recording",
    api=API_VERSION,
    commands={
        "record": "chefbotd.components.recording.cli.commands:record",
        "log": "chefbotd.components.recording.cli.commands:log_group",
    },
    status=(StatusRow("recording", "chefbotd.components.recording.status_text:recording"),),
)
