"""What the component for the worker offers."""

from typing import TYPE_CHECKING, Any

from chefbotd.component import API_VERSION, Component, StatusRow

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.worker.parameters import WorkerParameters
    from chefbotd.features.feature import Feature


def build(context: "Context[WorkerParameters]") -> "Feature":
    """The process that runs skills; each component adds its own."""
    from chefbotd.components.worker.service import WorkerService, worker

    return worker(WorkerService(context.bus, context.clock, context.section, {}, context.substitute))


def is_enabled(section: "WorkerParameters", settings: Any) -> bool:
    """A lidar's scans are for skills of ours; without one it is there for those of strangers."""
    strangers = [stranger.component for stranger in settings.strangers if stranger.component is not None]
    has_skills = bool(settings.lidar) or any(component.skills for component in strangers)
    return has_skills and section.enabled


COMPONENT = Component(
    name="worker",
    api=API_VERSION,
    section="chefbotd.components.worker.parameters:WorkerParameters",
    build=build,
    is_enabled=is_enabled,
    exclusive=True,
    status=(StatusRow("worker", "chefbotd.components.worker.status_text:worker", after="mapping"),),
)
