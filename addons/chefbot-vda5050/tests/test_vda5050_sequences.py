"""Random sequences of orders, stops, faults and lost connections: the robot drives for no order from before a stop.

``make sequences SEQUENCES=1000000`` runs more of them.
"""

import asyncio
import os
import random

import pytest
from chefbot_vda5050.messages import NodePosition
from vda5050_fakes import FakeRobot, Fleet, fleet
from vda5050_orders import line

from tests.fakes.sequences import run_sequences

LENGTH = 14
DEEDS = (
    *("order", "order", "update", "update", "go on", "stopPause", "cancelOrder"),
    *("disarm", "arm", "arm", "stop", "stop while away", "away", "back", "back"),
    *("slow planner", "fast planner", "moment", "moment", "wait", "wait long"),
)


class Watched(FakeRobot):
    """Counts what has stopped it; ``decided_at`` is that count when somebody last decided that it drives."""

    def __init__(self) -> None:
        super().__init__()
        self.stops, self.decided_at, self.drives = 0, -1, 0
        self.problem = ""
        self.set_quietly(stop_number=5 << 20)

    def set_quietly(self, **changes: object) -> None:
        """Change the facts before anybody listens."""
        self.set(**changes)

    def stop_now(self, **changes: object) -> None:
        """Somebody stops it, or a fault does: the daemon ends its goal."""
        self.stops += 1
        self._goal += 1
        self.set(stop_number=self.facts.stop_number + 1, **changes)

    async def drive_to(self, position: NodePosition, max_speed_m_s: float | None = None) -> None:
        """As ever, where somebody decided on it since the last stop."""
        self.drives += 1
        if self.decided_at != self.stops:
            self.problem = "it drives for what was decided before a stop"
        await super().drive_to(position, max_speed_m_s)


class Run:
    """One sequence."""

    def __init__(self, now: Fleet, robot: Watched) -> None:
        self._now, self._robot = now, robot
        self._orders, self._update, self._acts = 0, 0, 0

    async def do(self, deed: str) -> None:
        """One deed, and a moment for what follows."""
        now, robot = self._now, self._robot
        may_decide = robot.facts.armed and robot.facts.connected
        if deed == "order":
            robot.decided_at = robot.stops if may_decide else robot.decided_at
            self._orders, self._update = self._orders + 1, 0
            await now.order(line(0, 3, base=1, order_id=f"o{self._orders}"))
        elif deed == "update":
            robot.decided_at = robot.stops if may_decide else robot.decided_at
            self._update += 1
            await now.order(line(1, 3, update=self._update, order_id=f"o{self._orders}"))
        elif deed == "go on":
            robot.decided_at = robot.stops
            robot.go_on()
        elif deed in ("stopPause", "cancelOrder"):
            robot.decided_at = robot.stops if deed == "stopPause" else robot.decided_at
            self._acts += 1
            await now.act(deed, f"a{self._acts}")
        elif deed == "disarm" and robot.facts.armed and robot.facts.connected:
            robot.stop_now(armed=False)
        elif deed == "arm" and robot.facts.connected:
            robot.set(armed=True)
        elif deed == "stop" and robot.facts.connected:
            robot.stop_now()
        elif deed == "away" and robot.facts.connected:
            robot._goal += 1
            robot.set(connected=False, armed=True)
        elif deed == "stop while away" and not robot.facts.connected:
            robot.stops += 1
        elif deed == "back" and not robot.facts.connected:
            robot.set(connected=True, stop_number=(5 << 20) + robot.stops)
        elif deed.endswith("planner"):
            robot.planning_s = 0.3 if deed == "slow planner" else 0.0
        await asyncio.sleep({"wait": 1.0, "wait long": 5.0, "moment": 0.1}.get(deed, 0.01))


async def one(choose: random.Random) -> int:
    """A random sequence; how often it has driven."""
    robot = Watched()
    deeds = choose.choices(DEEDS, k=LENGTH)
    async with fleet(robot) as now:
        run = Run(now, robot)
        for count, deed in enumerate(deeds, 1):
            await run.do(deed)
            assert not robot.problem, f"{robot.problem}: {', '.join(deeds[:count])}"
    return robot.drives


@pytest.mark.parametrize(
    "number", [100, pytest.param(int(os.environ.get("SEQUENCES", "10000")), marks=pytest.mark.slow)]
)
def test_no_order_from_before_a_stop_has_the_robot_drive(number: int) -> None:
    """Whoever waits for a planner, for its daemon or behind another; and a share of the sequences does drive."""
    assert sum(drives > 0 for drives in run_sequences(one, number, seed=37)) > number / 20
