"""What the component for the simulated robot offers."""

from chefbotd.component import API_VERSION, Component, StatusRow

COMPONENT = Component(
    name="simulation",
    api=API_VERSION,
    status=(StatusRow("sim", "chefbotd.components.simulation.status_text:truth", ages=True),),
)
