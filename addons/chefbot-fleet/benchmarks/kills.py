"""Kills at random moments: ``python addons/chefbot-fleet/benchmarks/kills.py`` (KILLS=50 of each kind).

Two robots that keep to the standard bring four orders in simulated time; the manager, the broker or a robot is killed
once at a random moment, and started again; in the last line one of three robots 25 times. The manager has nothing but
its database then, the robot forgets its order.
"""

import os
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from fleet_world import VICTIMS, World, small_roadmap

AGAIN = "robots*25"


def main() -> None:
    """A line for each kind; exit code 1 if an order was lost, doubled or driven late."""
    kills, failed = int(os.environ.get("KILLS", "50")), False
    print(
        "killed     times  orders  lost  done by two  asked again by a robot that forgot  refused by a robot"
    )
    for victim in (*VICTIMS, AGAIN):
        lost = doubled = repeated = refused = 0
        for seed in range(kills):
            with tempfile.TemporaryDirectory() as folder:
                world = World(
                    small_roadmap(), Path(folder) / "fleet.db", robots=3 if victim == AGAIN else 2, seed=seed
                )
                world.give(4)
                if victim == AGAIN:
                    world.kill_robots_and_go_on(25)
                else:
                    world.kill_and_go_on(victim)
                lost += world.lost()
                doubled += world.done_by_two()
                repeated += world.repeated()
                refused += sum(len(robot.refused) for robot in world.robots.values())
        print(f"{victim:9}  {kills:5}  {4 * kills:6}  {lost:4}  {doubled:11}  {repeated:34}  {refused:18}")
        failed = failed or lost > 0 or doubled > 0
    sys.exit(failed)


if __name__ == "__main__":
    main()
