"""A reading after a silent second is held against what the board obeyed meanwhile, not against the newest command."""

import asyncio
import math

from chefbotd.core.events import EncodersCounted, WheelsMeasured
from chefbotd.core.geometry import Twist2D
from chefbotd.motion.kinematics import ChassisParameters
from tests.chefbotd.driving.rig import Rig, on_rig

COUNTS_PER_TURN, RADIUS_M = 1000, 0.05
FOUR_WHEELS = ChassisParameters.model_validate(
    {
        "track_width_m": 0.3,
        "wheels": [
            {"name": f"{place}_{side}_wheel", "side": side, "radius_m": RADIUS_M}
            for place in ("front", "rear")
            for side in ("left", "right")
        ],
    }
)


class FourWheels:
    """A board with a clock of its own, whose wheels roll as far as they are told."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._rolled_m = [0.0] * 4

    def report(self, *rolled_m: float) -> None:
        """An encoder line, 2 ms old, after the wheels have rolled so far."""
        self._rolled_m = [before + more for before, more in zip(self._rolled_m, rolled_m, strict=True)]
        turn_m = math.tau * RADIUS_M
        counts = tuple(round(way_m / turn_m * COUNTS_PER_TURN) for way_m in self._rolled_m)
        now_s = self._rig.clock.now_s()
        self._rig.bus.publish(EncodersCounted(now_s - 0.002, now_s, now_s - 500.0, counts))

    async def drive(self, seconds: float, linear_m_s: float) -> None:
        """Commands and lines every 20 ms, which are obeyed at once."""
        for _ in range(round(seconds / 0.02)):
            self._rig.service.command("teleop", Twist2D(linear_m_s, 0.0))
            await asyncio.sleep(0.02)
            self.report(*[linear_m_s * 0.02] * 4)


def test_the_wheel_that_did_as_the_board_was_told_is_believed() -> None:
    """At 0.1 m/s the board is silent for a second, and is told zero meanwhile, which it does not read.

    Both wheels of the right side and the front left one roll 0.1 m, as they had been told; the rear left one slips, by
    0.2 m. Held against zero, the one that rolled farthest would be believed.
    """

    async def scenario(rig: Rig) -> None:
        board = FourWheels(rig)
        await board.drive(1.0, 0.1)
        await asyncio.sleep(1.0)
        assert not any(rig.duty)
        board.report(0.1, 0.1, 0.2, 0.1)
        measured = [rig.wheels.take_event() for _ in range(len(rig.wheels))]
        last = [event for event in measured if isinstance(event, WheelsMeasured)][-1]
        assert last.excluded == (2,)

    on_rig(scenario, chassis=FOUR_WHEELS)
