"""What the component for stored maps offers."""

from chefbotd.component import API_VERSION, Component

COMPONENT = Component(
    name="maps",
    api=API_VERSION,
    commands={
        "map": "chefbotd.components.maps.cli.commands:map_group",
        "places": "chefbotd.components.maps.cli.places:places",
    },
)
