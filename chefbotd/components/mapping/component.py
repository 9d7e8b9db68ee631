"""What the component for making maps offers."""

from chefbotd.component import API_VERSION, Component, StatusRow

COMPONENT = Component(
    name="mapping",
    api=API_VERSION,
    status=(StatusRow("mapping", "chefbotd.components.mapping.status_text:mapping"),),
)
