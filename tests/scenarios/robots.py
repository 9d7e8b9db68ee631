"""The robots that scenarios drive: the packaged ones, and ChefBot with each of the published sketches on its board.

``chefbot/duemilanove`` is a ChefBot whose simulated board runs that sketch.
"""

from collections.abc import Mapping

from chefbotd.settings import Settings, load, packaged
from chefbotd.sim_parameters.sketches import PUBLISHED_SKETCHES

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
