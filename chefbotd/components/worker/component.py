"""What the component for the worker offers."""

from chefbotd.component import API_VERSION, Component, StatusRow

COMPONENT = Component(
    name="worker",
    api=API_VERSION,
    status=(StatusRow("worker", "chefbotd.components.worker.status_text:worker"),),
)
