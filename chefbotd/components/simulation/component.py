"""What the component for the simulated robot offers to the daemon that drives it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from chefbotd.component import API_VERSION, Component, Hardware, RunOption, StatusRow

if TYPE_CHECKING:
    from chefbotd.component_context import Context
    from chefbotd.features.feature import Feature


SKETCHES = ("tiva", "tiva_bare", "duemilanove", "tiva_second", "chefbot", "emulated")
OWN_FIRMWARE = ("chefbot", "emulated")
SKETCH = "Which sketch the simulated board runs, instead of the configured one; chefbot: our own firmware."
WHICH_PHYSICS = "What moves the simulated robot, instead of what is configured; mujoco is an extra."


def keys_of_sketch(sketch: str) -> Mapping[str, object]:
    """A simulated board counts as is configured, and the daemon asks whose counts that are."""
    counted_by = "firmware" if sketch in OWN_FIRMWARE else "sketch"
    return {"sim.board.sketch": sketch, "encoders.counted_by": counted_by}


def build(context: "Context[None]") -> "list[Feature]":
    """The topic with the truth, which only a simulated robot has."""
    if not context.parts.context.simulated:
        return []
    from chefbotd.components.simulation.models import TOPICS
    from chefbotd.features.feature import Feature

    return [Feature("simulation", topics=TOPICS)]


COMPONENT = Component(
    name="simulation",
    api=API_VERSION,
    section="chefbotd.components.simulation.parameters.simulation:SimulationParameters",
    section_key="sim",
    short_forms={"world": "map_path", "true": "drawn"},
    wheelbase_m=lambda section: section.body.wheelbase_m,
    build=build,
    hardware=Hardware(
        "--sim",
        "Drive a simulated robot; no device is needed.",
        check="chefbotd.components.simulation.command:check_simulation",
        clock="chefbotd.components.simulation.process.hardware:clock_of",
        connect="chefbotd.components.simulation.process.hardware:connect",
    ),
    run_options=(
        RunOption("--sketch", SKETCH, keys_of_sketch, SKETCHES, "a real board runs its own"),
        RunOption(
            "--physics",
            WHICH_PHYSICS,
            lambda physics: {"sim.physics": physics},
            ("planar", "mujoco"),
            "it moves a simulated robot",
        ),
    ),
    daemon_commands={"simulate": "chefbotd.components.simulation.command:simulate"},
    status=(
        StatusRow("sim", "chefbotd.components.simulation.status_text:truth", after="recording", ages=True),
    ),
)
