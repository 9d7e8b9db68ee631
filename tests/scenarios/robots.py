"""The robots that scenarios drive: the packaged ones, and ChefBot with each of the published sketches on its board.

``chefbot/duemilanove`` is a ChefBot whose simulated board runs that sketch.
"""

from collections.abc import Mapping

from chefbotd.settings import Settings, load, packaged
from chefbotd.sim_parameters.sketches import PUBLISHED_SKETCHES

CYCLE_S, ECHO_S = 0.05, 0.025
"""Of the slowest published sketch, ChefBot's default: its cycle, and the echo of 4 m that it waits for."""

OBEYED_S = CYCLE_S + ECHO_S
"""The longest from a command on the wire until it is in force: it is read once a cycle, after the echo."""

ROBOTS = ("chefbot", "khan")
SKETCHED = tuple(f"chefbot/{sketch.value}" for sketch in PUBLISHED_SKETCHES)
EVERY_ROBOT = (*ROBOTS, *SKETCHED)


def packaged_name(robot: str) -> str:
    """The packaged robot that it is, whatever its board runs."""
    return robot.partition("/")[0]


def settings_of(robot: str, overrides: Mapping[str, object]) -> Settings:
    """Its configuration, with these changes."""
    name, _, sketch = robot.partition("/")
    runs = {"sim.board.sketch": sketch} if sketch else {}
    return load(packaged(name), overrides={**runs, **overrides})
