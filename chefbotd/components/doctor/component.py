"""What the component for finding what is wrong offers."""

from chefbotd.component import API_VERSION, Component

COMPONENT = Component(
    name="doctor",
    api=API_VERSION,
    commands={
        "doctor": "chefbotd.components.doctor.cli.doctor_command:doctor",
        "ports": "chefbotd.components.doctor.cli.doctor_command:ports",
    },
)
