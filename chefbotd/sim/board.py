"""Runs the simulated board in an event loop: bytes leave when the board's time has come."""

import asyncio
from collections.abc import Callable

from chefbotd.clock import Clock
from chefbotd.core.events import TruthSimulated
from chefbotd.sim.arrays import Vector
from chefbotd.sim.crowd import Crowd
from chefbotd.sim.launchpad import Launchpad

STALE_S = 0.5


class BoardRunner:
    """Powers a board on at construction, and runs it at the pace of the clock.

    Lines are due at absolute times, so delays do not add up. Lines more than ``STALE_S`` late are counted and not
    sent: after a long stall the host gets the present, not minutes of the past at once.
    """

    def __init__(self, launchpad: Launchpad, send: Callable[[bytes], None], clock: Clock) -> None:
        self._launchpad, self._send, self._clock = launchpad, send, clock
        self._powered_on_s = clock.now_s()
        self.lines_skipped = 0

    @property
    def duty(self) -> tuple[int, ...]:
        """The motor command in force."""
        return self._launchpad.sketch.duty

    def lose_echoes(self, lost: bool) -> None:
        """Set whether the ultrasonic sensor has nothing in reach from now on, as in a large hall."""
        self._launchpad.sketch.loses_echoes = lost

    @property
    def received_dropped(self) -> int:
        """How many bytes from the host were lost because the board's receive buffer was full."""
        return self._launchpad.uart.received_dropped

    def receive(self, data: bytes) -> None:
        """Bytes from the host, arriving now."""
        self._launchpad.receive(data, self.board_s())

    def truth(self, stamp_s: float) -> TruthSimulated:
        """The true pose and motion of the robot now, with the given stamp."""
        return self._launchpad.truth(self.board_s(), stamp_s)

    def trail(self, since_s: float) -> Vector:
        """The robot's poses since this board time: rows of time, x, y, heading, one per step."""
        return self._launchpad.trail(self.board_s(), since_s)

    @property
    def crowd(self) -> Crowd:
        """People and things around the robot; things can be put there and taken away."""
        return self._launchpad.robot.crowd

    async def run(self) -> None:
        """Send until cancelled."""
        while True:
            due_s = self._launchpad.next_event_s()
            await asyncio.sleep(max(due_s - self.board_s(), 0.0))
            self._send_until(max(due_s, self.board_s()))

    def _send_until(self, now_s: float) -> None:
        lines = self._launchpad.advance(now_s)
        fresh = [line for left_s, line in lines if now_s - left_s <= STALE_S]
        self.lines_skipped += len(lines) - len(fresh)
        if fresh:
            self._send(b"".join(fresh))

    def board_s(self) -> float:
        """For how long the board has been powered on."""
        return self._clock.now_s() - self._powered_on_s
