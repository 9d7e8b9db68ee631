"""What the component for depth cameras offers to the daemon."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, SectionForm

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.depth_camera.link.process import Spawn
    from chefbotd.components.depth_camera.parameters import DepthSourceParameters
    from chefbotd.features.feature import Feature

Section = tuple["DepthSourceParameters", ...]


def build(context: "Context[Section]") -> "Feature":
    """A process for each camera. Without a lidar it also brings the topic of scans."""
    from chefbotd.components.depth_camera.service import depth_cameras
    from chefbotd.driving.lidars.service import topics

    scan = [] if context.settings.lidar else [topic for topic in topics(()) if topic.name == "scan"]
    rng = context.parts.context.rng
    return depth_cameras(context.section, context.bus, context.clock, rng, _spawn(context), scan)


def _spawn(context: "Context[Section]") -> "Spawn":
    """What starts a camera's process; on a simulated robot that of a simulated camera."""
    board = context.parts.context.substitutes.get("simulation")
    if context.substitute is not None:
        given: Spawn = context.substitute
        return given
    if board is None:
        from chefbotd.components.depth_camera.link.process import spawn_program

        return spawn_program
    from chefbotd.components.depth_camera.simulated.spawn import spawn_simulated
    from chefbotd.components.simulation.parameters.simulation import SimulationParameters

    return spawn_simulated(board, context.settings.of("sim", SimulationParameters))


COMPONENT = Component(
    name="depth_camera",
    api=API_VERSION,
    section="chefbotd.components.depth_camera.parameters:DepthSourceParameters",
    form=SectionForm.LIST,
    scanners=lambda section: section,
    build=build,
    is_enabled=lambda section, settings: bool(section),
    exclusive=True,
)
