"""A board of somebody's own, on the virtual clock: two wheels that are turned by hand, or by their motors on blocks."""

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator

from chefbotd.client import Client
from chefbotd.clock import LoopClock
from chefbotd.process.build import build
from chefbotd.process.own_daemon import alone
from chefbotd.settings import Settings
from chefbotd.testing.transport import FakeSerialDevice
from chefbotd.testing.worker import no_worker

CYCLE_S = 0.02


class OwnBoard:
    """It sends ``t``, ``e`` and ``s`` fifty times a second, and has no sensors.

    Its motors turn at ``gain_rad_s`` for each duty beyond ``dead_zone``; ``motor_signs`` and ``encoder_signs`` are its
    wiring. ``swaps_encoders``: each wheel is counted by the other's encoder.
    """

    def __init__(
        self,
        counts_per_turn: float = 1440.0,
        *,
        gain_rad_s: float = 0.08,
        dead_zone: float = 30.0,
        motor_signs: tuple[int, int] = (1, 1),
        encoder_signs: tuple[int, int] = (1, 1),
        swaps_encoders: bool = False,
    ) -> None:
        self.device = FakeSerialDevice()
        self.device.on_write = self._hear
        self.counts_per_turn, self.gain_rad_s, self.dead_zone = counts_per_turn, gain_rad_s, dead_zone
        self.motor_signs, self.encoder_signs = motor_signs, encoder_signs
        self.swaps_encoders = swaps_encoders
        self.duty = [0, 0]
        self.turned_rad = [0.0, 0.0]
        self.hardest_duty = 0
        self._pending = b""

    def turn(self, wheel: int, turns: float) -> None:
        """Somebody turns a wheel, forward positive."""
        self.turned_rad[wheel] += turns * math.tau

    def pivot(self, turns: float, track_m: float, radius_m: float) -> None:
        """Somebody turns the robot on the floor to the left."""
        rolled_turns = turns * track_m / 2 / radius_m
        self.turn(0, -rolled_turns)
        self.turn(1, rolled_turns)

    def _hear(self, data: bytes) -> None:
        *lines, self._pending = (self._pending + data).split(b"\r")
        for line in lines:
            words = line.split()
            if words[:1] == [b"s"] and len(words) == 3:
                self.duty = [int(words[1]), int(words[2])]
                self.hardest_duty = max(self.hardest_duty, *map(abs, self.duty))

    def speed_rad_s(self, wheel: int) -> float:
        """How fast the motor turns its wheel, forward positive."""
        duty = self.duty[wheel]
        return self.motor_signs[wheel] * math.copysign(
            max(abs(duty) - self.dead_zone, 0) * self.gain_rad_s, duty
        )

    async def run(self) -> None:
        """Send a cycle's lines every 20 ms."""
        clock = LoopClock()
        while True:
            await asyncio.sleep(CYCLE_S)
            for wheel in (0, 1):
                self.turned_rad[wheel] += self.speed_rad_s(wheel) * CYCLE_S
            counts = [
                round(sign * turned / math.tau * self.counts_per_turn)
                for sign, turned in zip(self.encoder_signs, self.turned_rad, strict=True)
            ]
            if self.swaps_encoders:
                counts.reverse()
            micros = round(clock.now_s() * 1e6) % 2**32
            self.device.feed(
                f"t\t{micros}\t0.02\ne\t{counts[0]}\t{counts[1]}\ns\t{self.duty[0]}.00\t{self.duty[1]}.00\n".encode()
            )

    @contextlib.asynccontextmanager
    async def connect(self, settings: Settings) -> AsyncIterator[Client]:
        """A daemon with these settings at this board."""
        daemon = build(
            alone(settings), clock=LoopClock(), opener=self.device.open, substitutes={"worker": no_worker}
        )
        task = asyncio.create_task(daemon.run())
        try:
            host, port = await daemon.server.address()
            async with Client.connect(host, port, name="new-robot") as client:
                await client.wait_until_armed(timeout_s=5.0)
                yield client
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task
