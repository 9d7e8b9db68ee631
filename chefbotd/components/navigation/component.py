"""What the component for driving to goals offers."""

from chefbotd.component import API_VERSION, Component, StatusRow

COMPONENT = Component(
    name="navigation",
    api=API_VERSION,
    commands={
        "go": "chefbotd.components.navigation.cli.commands:go",
        "home": "chefbotd.components.navigation.cli.commands:home",
        "dock": "chefbotd.components.navigation.cli.commands:dock",
        "patrol": "chefbotd.components.navigation.cli.commands:patrol",
        "where": "chefbotd.components.navigation.cli.commands:where",
        "localize": "chefbotd.components.navigation.cli.commands:localize",
    },
    status=(StatusRow("navigation", "chefbotd.components.navigation.status_text:navigation"),),
)
