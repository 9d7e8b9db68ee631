"""Drives to every place of the map in turn, and says which it did not reach: ``python -m examples.patrol``."""

import math
from collections.abc import Mapping
from typing import Any

from chefbotd.client import CallError, Client, GoalNotReached, SleepWatch
from chefbotd.components.agents.agent import BY_PEOPLE
from chefbotd.core.geometry import Pose2D
from examples.program import run

ROUNDS = 2
LONGEST_SLEEP_S = 2.0
"""A patrol whose program, or computer, slept for longer is over: nobody expects it to go on."""


async def main(robot: Client) -> str:
    """Every round goes on where a place is not reached; a refusal, or somebody who stops the robot, ends the patrol.

    So does a stop that nobody has told of, between two places: each goal belongs to what was decided at the start.
    """
    decided = (await robot.get_state()).safety.stop_number
    places = [place.name for place in (await robot.list_places()).places]
    if not places:
        return "The map has no places: save some with 'chefbotctl places save'."
    missed: list[str] = []
    watch = SleepWatch()
    watch.renew(math.inf)
    for number in range(1, ROUNDS + 1):
        for place in places:
            try:
                await robot.navigate_to(place=place, if_stop_number=decided)
            except GoalNotReached as error:
                if error.cause in BY_PEOPLE:
                    return f"The patrol was stopped in round {number}: {error.reason}"
                missed.append(f"{place} in round {number}: {error.reason}")
            except CallError as error:
                return f"The patrol ended in round {number}: {error.message}"
            if (slept_s := watch.slept_s()) > LONGEST_SLEEP_S:
                return f"The patrol ended in round {number}: this program did not run for {slept_s:.0f} s."
    reached = ROUNDS * len(places) - len(missed)
    return "\n".join([f"{reached} of {ROUNDS * len(places)} visits were made.", *missed])


def simulated(world: str, seed: int) -> Mapping[str, Any]:
    """Three places of the flat."""
    places = {
        "sofa": Pose2D(2.6, 4.0, 0.4),
        "kitchen": Pose2D(6.1, 1.6, -1.57),
        "desk": Pose2D(5.0, 5.5, 1.0),
    }
    return {"start": Pose2D(2.45, 2.6, 2.1), "places": places}


if __name__ == "__main__":
    run(main, simulated)
