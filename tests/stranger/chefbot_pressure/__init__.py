"""A component of a stranger: an air pressure sensor, and how far the robot has driven since its last reading."""

from chefbotd.component import Component, PagePart, StatusRow

COMPONENT = Component(
    name="pressure",
    api=1,
    section="chefbot_pressure.service:PressureParameters",
    build="chefbot_pressure.service:build",
    paths=("file",),
    check="chefbot_pressure.service:check",
    events=("chefbot_pressure.service:PressureMeasured", "chefbot_pressure.service:PressureRose"),
    skills={"distance": "chefbot_pressure.skill:DistanceSkill"},
    commands={"pressure": "chefbot_pressure.commands:pressure"},
    status=(StatusRow("pressure", "chefbot_pressure.commands:fact", after="battery", ages=True),),
    page=(PagePart("chefbot_pressure", "card.js", panel="drive", order=10),),
)
