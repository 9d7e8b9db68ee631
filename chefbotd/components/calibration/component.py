"""What the component for calibration offers."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, PagePart

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature

SOURCE = "calibration"


def build(context: "Context[None]") -> "Feature":
    """Calibrates the robot, as a source of commands of its own."""
    from chefbotd.components.calibration.build import calibration_of

    return calibration_of(context)


COMPONENT = Component(
    name="calibration",
    api=API_VERSION,
    build=build,
    in_loop="chefbotd.components.calibration.fit_process:fit_here",
    page=(PagePart("chefbotd.components.calibration", "card.js", order=70),),
    is_enabled=lambda section, settings: SOURCE in settings.safety.sources,
    commands={"calibrate": "chefbotd.components.calibration.cli.commands:calibrate"},
)
