"""What the component for calibration offers."""

from chefbotd.component import API_VERSION, Component

COMPONENT = Component(
    name="calibration",
    api=API_VERSION,
    commands={
        "calibrate": "chefbotd.components.calibration.cli.commands:calibrate",
    },
)
