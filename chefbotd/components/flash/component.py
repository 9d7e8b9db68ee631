"""What the component for flashing the board offers."""

from chefbotd.component import API_VERSION, Component

COMPONENT = Component(
    name="flash",
    api=API_VERSION,
    commands={
        "flash": "chefbotd.components.flash.command:flash",
    },
)
