"""What the component for depth cameras offers to the daemon."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


def build(context: "Context[None]") -> "Feature":
    """A process for each camera. Without a lidar it also brings the topic of scans."""
    from chefbotd.components.depth_camera.link.process import spawn_program
    from chefbotd.components.depth_camera.service import depth_cameras
    from chefbotd.driving.lidars.service import topics

    settings, daemon = context.settings, context.parts.context
    scan = [] if settings.lidar else [topic for topic in topics(()) if topic.name == "scan"]
    spawn = daemon.depth_spawn or spawn_program
    return depth_cameras(settings.depth_camera, context.bus, context.clock, daemon.rng, spawn, scan)


COMPONENT = Component(
    name="depth_camera",
    api=API_VERSION,
    build=build,
    is_enabled=lambda section, settings: bool(settings.depth_camera),
)
