"""The robots that scenarios drive: the packaged ones, and ChefBot with each of the published sketches on its board.

No robot is quite as its configuration says: each is drawn as a plausible one (``AS_BUILT``).

``chefbot/duemilanove`` is a ChefBot whose simulated board runs that sketch.
"""

from collections.abc import Mapping

from chefbotd.components.simulation.parameters.sketches import CHEFBOT_SKETCHES, OWN_FIRMWARE, SketchName
from chefbotd.components.simulation.process.simulated_robot import true_of
from chefbotd.settings import Settings, load, packaged

CYCLE_S, ECHO_S = 0.05, 0.025
"""Of the slowest published sketch, ChefBot's default: its cycle, and the echo of 4 m that it waits for."""

OBEYED_S = CYCLE_S + ECHO_S
"""The longest from a command on the wire until it is in force: it is read once a cycle, after the echo."""

ROBOTS = ("chefbot", "khan")
SKETCHED = tuple(f"chefbot/{sketch.value}" for sketch in CHEFBOT_SKETCHES)
EMULATED = f"chefbot/{SketchName.EMULATED.value}"
"""Our firmware's own image: it needs its compilers and its emulator, so it is tried where it is asked for."""

EVERY_ROBOT = (*ROBOTS, *SKETCHED, EMULATED)
BOARDS = (*ROBOTS, *SKETCHED[1:])
"""A robot for each sketch: ChefBot's board runs the first of the published ones unless told otherwise."""


AS_CONFIGURED = {"sim.true.drawn": "perfect"}
"""Changes of a configuration: the simulated robot is exactly as the rest of it says.

Robots that crawl because a sensor is silent need it. They turn to a goal by short commands, one a second; where a dead
zone is 10 % larger than configured, 28 of duty do not start the wheels, and the goal ends as blocked.
"""

AS_BUILT = {"sim.true.drawn": "plausible"}
"""Changes of a configuration: the simulated robot differs from it as one that was built with care does."""


def knowing_its_size(settings: Settings) -> Settings:
    """The same simulated robot, in the configuration of which radii and track are as they are."""
    true = true_of(settings)
    wheels = [
        wheel.model_copy(update={"radius_m": true.wheels[wheel.name].radius_m})
        for wheel in settings.chassis.wheels
    ]
    sizes = {"wheels": tuple(wheels), "track_width_m": true.track_width_m, "track_multiplier": 1.0}
    chassis = settings.chassis.model_copy(update=sizes)
    sim = settings.sim.model_copy(update={"true": true})
    return settings.model_copy(update={"chassis": chassis, "sim": sim})


def packaged_name(robot: str) -> str:
    """The packaged robot that it is, whatever its board runs."""
    return robot.partition("/")[0]


def sketch_of(robot: str) -> str:
    """The published sketch that was chosen for its board; empty where that is the configured one."""
    return robot.partition("/")[2]


def settings_of(robot: str, overrides: Mapping[str, object]) -> Settings:
    """Its configuration, with these changes."""
    sketch = sketch_of(robot)
    runs = {"sim.board.sketch": sketch} if sketch else {}
    if sketch in OWN_FIRMWARE:
        runs["encoders.counted_by"] = "firmware"
    return load(packaged(packaged_name(robot)), overrides={**AS_BUILT, **runs, **overrides})
