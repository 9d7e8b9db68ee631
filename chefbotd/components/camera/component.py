"""What the component for a camera offers to the daemon."""

from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, PagePart, StatusRow

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.components.camera.link.source import OpenSource
    from chefbotd.components.camera.parameters import CameraParameters
    from chefbotd.features.feature import Feature


def build(context: "Context[CameraParameters]") -> "Feature":
    """Shows what the robot sees."""
    from chefbotd.components.camera.camera import Camera
    from chefbotd.components.camera.service import camera_feature

    rng = context.parts.context.rng
    camera = Camera(context.section, context.bus, context.clock, _open_source(context), rng)
    return camera_feature(camera, context.clock)


def _open_source(context: "Context[CameraParameters]") -> "OpenSource":
    """What opens the camera; on a simulated robot a simulated one."""
    if context.substitute is not None:
        given: OpenSource = context.substitute
        return given
    board = context.parts.context.substitutes.get("simulation")
    if board is not None:
        from chefbotd.components.camera.simulated.source import open_simulated
        from chefbotd.components.simulation.parameters.simulation import SimulationParameters

        return open_simulated(board, context.settings.of("sim", SimulationParameters))
    from chefbotd.components.camera.link.command import CommandCapture
    from chefbotd.components.camera.link.source import open_threads
    from chefbotd.components.camera.link.v4l2 import V4l2Capture
    from chefbotd.components.camera.parameters import CameraSource

    return open_threads(V4l2Capture if context.section.source is CameraSource.V4L2 else CommandCapture)


COMPONENT = Component(
    name="camera",
    api=API_VERSION,
    section="chefbotd.components.camera.parameters:CameraParameters",
    build=build,
    is_enabled=lambda section, settings: section.enabled,
    exclusive=True,
    page=(PagePart("chefbotd.components.camera", "card.js", panel="camera"),),
    status=(StatusRow("camera", "chefbotd.components.camera.status_text:camera"),),
    commands={"camera": "chefbotd.components.camera.cli:camera"},
)
