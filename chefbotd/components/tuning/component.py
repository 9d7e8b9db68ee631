"""What the component for tuning offers to the daemon."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


def build(context: "Context[None]") -> "Feature":
    """Tunes the loop that drives; an output limit may not be so low that a stalled wheel is not found."""
    from chefbotd.components.tuning.service import TuningService, tuning

    settings = context.settings
    most_duty = settings.drive.max_duty
    watched_duty = most_duty * settings.safety.wheels.driven_duty_share
    return tuning(TuningService(context.parts.driving.wheels, most_duty, watched_duty))


COMPONENT = Component(
    name="tuning",
    api=API_VERSION,
    build=build,
    commands={"pid": "chefbotd.components.tuning.cli.commands:pid"},
)
