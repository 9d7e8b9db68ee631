"""What the component for describing a robot of one's own offers."""

from chefbotd.component import API_VERSION, Component

COMPONENT = Component(
    name="new_robot",
    api=API_VERSION,
    commands={"new-robot": "chefbotd.components.new_robot.command:new_robot"},
)
