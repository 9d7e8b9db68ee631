"""What ends a procedure, and how that is said, with a driver that does nothing."""

import asyncio
from typing import cast

import pytest

from chefbotd.bus import Bus
from chefbotd.calibration.step import Move, Procedure
from chefbotd.clock import LoopClock, run_virtual
from chefbotd.core.commands import Refused
from chefbotd.core.events import SafetyChanged, WheelsMeasured
from chefbotd.core.geometry import Motion, Twist2D
from chefbotd.features.calibration.carrying_out import ProcedureRunner
from chefbotd.features.driving.inner_driver import InnerDriver


class Driver:
    """Takes every motion."""

    source, stops, stopped_by = "calibration", 0, ""

    def begin(self) -> None:
        """Begin."""

    def drive(self, motion: Motion, wished_s: float) -> None:
        """Drive."""

    def let_go(self) -> None:
        """Let go."""


def _drives() -> Procedure:
    yield Move(Twist2D(0.1, 0.0), 0.5, "drives")


@pytest.mark.parametrize(
    ("limited_by", "words"),
    [
        (None, "the wheels did not come to rest within 3 s$"),
        ("no_echo", "calibrate where something stands within 4 m ahead of the robot$"),
    ],
)
def test_wheels_that_never_rest_end_a_step(limited_by: str | None, words: str) -> None:
    """They turn on for 3 s after the motion: that is said, and of a board without an echo what to do about it."""

    async def run() -> None:
        bus, loop = Bus(), asyncio.get_running_loop()
        runner = ProcedureRunner(bus, LoopClock(), cast("InnerDriver", Driver()), lambda action: None)
        bus.publish(SafetyChanged(loop.time(), "armed", "", "calibration", None, limited_by))

        async def turn() -> None:
            while True:
                now_s = loop.time()
                bus.publish(WheelsMeasured(now_s, now_s, now_s, (0.0, 0.0), (0.0, 0.0), (1.0, 1.0)))
                await asyncio.sleep(0.05)

        turning = asyncio.create_task(turn())
        await asyncio.sleep(0.1)
        with pytest.raises(Refused, match=words):
            await runner.run(_drives())
        turning.cancel()

    run_virtual(run())


def test_a_board_that_falls_silent_ends_a_step() -> None:
    """Without a reading of the wheels for 2 s nothing is driven any more."""

    async def run() -> None:
        bus, loop = Bus(), asyncio.get_running_loop()
        runner = ProcedureRunner(bus, LoopClock(), cast("InnerDriver", Driver()), lambda action: None)
        now_s = loop.time()
        bus.publish(WheelsMeasured(now_s, now_s, now_s, (0.0, 0.0), (0.0, 0.0), (1.0, 1.0)))
        with pytest.raises(Refused, match="has not told of its wheels for 2 s"):
            await runner.run(_drives())
        assert loop.time() - now_s < 3.0

    run_virtual(run())
