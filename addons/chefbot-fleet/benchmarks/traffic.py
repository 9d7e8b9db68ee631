"""Traffic in the simulator's office: ``python addons/chefbot-fleet/benchmarks/traffic.py`` (ORDERS=1000 SEEDS=20).

For each seed: orders between any two of eight rooms, with robots as fast as planned (calm) and with robots that are late
and vanish (rough). The last column compares the calm run with LaCAM on the same roadmap and orders (``lacam.py``).
"""

import os
import random
import sys
import time

from chefbot_fleet.assignment import Order
from chefbot_fleet.lanes import LaneParameters, find_lanes
from chefbot_fleet.roadmap import Roadmap
from chefbot_fleet.routes import Pace
from chefbot_fleet.simulation import CALM, ROUGH, FleetSimulation
from lacam import lacam_orders_per_hour

from chefbotd.components.simulation.rooms import BUILDINGS

ROBOTS, DWELL_S, PACE, LANES = 10, 5.0, Pace(), LaneParameters()
PLACES = {
    **{f"room {k + 1}": (6 * k + 2.9, 1.6) for k in range(4)},
    **{f"room {k + 5}": (6 * k + 4.6, 8.0) for k in range(3)},
    "room 8": (21.5, 8.3),
}
HEADER = (
    "seed  run    done  twice  lost  nearest (m)  touched  deadlocks  vanished  orders/h  of LaCAM  CPU (s)"
)


def one_seed(roadmap: Roadmap, homes: tuple[int, ...], count: int, seed: int) -> bool:
    """Print a line for each run; whether all was as promised."""
    chance, nodes = random.Random(seed), list(roadmap.names.values())
    orders = [Order(f"order {k}", *chance.sample(nodes, 2)) for k in range(count)]
    reference = lacam_orders_per_hour(roadmap, PACE, homes, orders, DWELL_S, seed)
    passed = True
    for name, disturbance in (("calm", CALM), ("rough", ROUGH)):
        begun_s = time.process_time()
        fleet = FleetSimulation(
            roadmap, PACE, homes, orders, dwell_s=DWELL_S, disturbance=disturbance, seed=seed
        )
        result = fleet.run(100.0 * count)
        done = list(result.done.values())
        touched = result.least_distance_m <= 2 * LANES.radius_m
        twice, lost = sum(k > 1 for k in done), sum(k == 0 for k in done)
        passed = passed and not (touched or twice or lost or result.deadlocks)
        share = f"{result.per_hour / reference:8.0%}" if name == "calm" else " " * 8
        print(
            f"{seed:4}  {name:5} {sum(done):5}  {twice:5}  {lost:4}  {result.least_distance_m:11.3f}  "
            f"{'yes' if touched else 'no':>7}  {result.deadlocks:9}  {result.vanished:8}  {result.per_hour:8.0f}  "
            f"{share}  {time.process_time() - begun_s:7.0f}",
            flush=True,
        )
    return passed


def main() -> None:
    """All seeds; exit code 1 if an order was lost or done twice, robots touched or a deadlock came."""
    count, seeds, first = (
        int(os.environ.get(*key)) for key in (("ORDERS", "1000"), ("SEEDS", "20"), ("FIRST", "0"))
    )
    roadmap = find_lanes(BUILDINGS["office"].grid(), LANES, PLACES)
    homes = roadmap.homes(ROBOTS)
    print(HEADER)
    passed = [one_seed(roadmap, homes, count, seed) for seed in range(first, first + seeds)]
    sys.exit(0 if all(passed) else 1)


if __name__ == "__main__":
    main()
