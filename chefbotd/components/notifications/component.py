"""What the component for notifications offers to the daemon."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, PagePart, StatusRow

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.notifications.parameters import NotificationsParameters
    from chefbotd.features.feature import Feature
    from chefbotd.settings import Settings


def build(context: "Context[NotificationsParameters]") -> "Feature":
    """Tells somebody who is away."""
    from chefbotd.components.notifications.service import notifications

    return notifications(context.bus, context.clock, context.section, context.robot_name)


def check(section: "NotificationsParameters", settings: "Settings") -> Iterator[str]:
    """Whoever enables it says where messages go."""
    if section.enabled and section.ntfy_url is None and section.webhook_url is None:
        yield "notifications.enabled: expected ntfy_url or webhook_url beside it, to say where messages go"


COMPONENT = Component(
    name="notifications",
    api=API_VERSION,
    section="chefbotd.components.notifications.parameters:NotificationsParameters",
    build=build,
    check=check,
    is_enabled=lambda section, settings: section.enabled,
    outward=True,
    page=(PagePart("chefbotd.components.notifications", "card.js", panel="people", order=60),),
    status=(StatusRow("notifications", "chefbotd.components.notifications.status_text:notifications"),),
    daemon_commands={"notify": "chefbotd.components.notifications.cli:notify"},
)
