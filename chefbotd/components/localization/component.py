"""What the component for localization offers."""

from chefbotd.component import API_VERSION, Component, StatusRow

COMPONENT = Component(
    name="localization",
    api=API_VERSION,
    status=(StatusRow("localization", "chefbotd.components.localization.status_text:localization"),),
)
