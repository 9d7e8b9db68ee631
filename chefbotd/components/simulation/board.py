"""Runs the simulated board in an event loop: bytes leave when the board's time has come."""

import asyncio
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Protocol

import numpy as np

from chefbotd.clock import Clock
from chefbotd.components.simulation.arrays import Vector
from chefbotd.components.simulation.crowd import Crowd
from chefbotd.components.simulation.parameters.sketches import BoardParameters
from chefbotd.components.simulation.peripherals import Uart
from chefbotd.components.simulation.plant import Push
from chefbotd.components.simulation.robot import Robot
from chefbotd.components.simulation.sketch import Sketch, Wiring
from chefbotd.core.events import TruthSimulated


class Program(Protocol):
    """What the board runs: the motor command in force, and whether its ultrasonic sensor has nothing in reach."""

    duty: tuple[int, ...]
    loses_echoes: bool


class SimulatedBoard(ABC):
    """A board wired to a robot, powered on at time 0. When and how often it is advanced changes nothing.

    ``uart`` counts what found its receive buffer full. ``heard_s`` is the board's time when the last byte from the host
    came in, ``duty_since_s`` when the motor command in force began; 0 before the first.
    """

    robot: Robot
    uart: Uart
    sketch: Program
    heard_s = 0.0
    duty_since_s = 0.0
    _resume_s = 0.0
    """When the program goes on, at the latest."""

    def next_event_s(self) -> float:
        """When to call ``advance`` next: no line leaves before then."""
        return min(self.uart.next_s, self._resume_s)

    def advance(self, to_s: float) -> list[tuple[float, bytes]]:
        """Run until ``to_s``: lines that left since the last call, with the times of their last bytes."""
        self._run(to_s)
        return self.uart.take_lines(to_s)

    @abstractmethod
    def receive(self, data: bytes, at_s: float) -> None:
        """Bytes from the host."""

    def duty_at(self, at_s: float) -> tuple[int, ...]:
        """The motor command in force at this time."""
        self._run(at_s)
        return self.sketch.duty

    def truth(self, at_s: float, stamp_s: float) -> TruthSimulated:
        """Where the robot really is at ``at_s`` of the board's time, stamped ``stamp_s``."""
        self._run(at_s)
        self.robot.advance(at_s)
        return self.robot.truth(stamp_s)

    def trail(self, at_s: float, since_s: float) -> Vector:
        """Where the robot was from ``since_s``, if that is no longer ago than its trail, to ``at_s``.

        Rows of time, x, y, heading (not wrapped), a step apart.
        """
        self._run(at_s)
        self.robot.advance(at_s)
        rows = []
        for row in reversed(self.robot.trail):
            rows.append(row)
            if row[0] <= since_s:
                break
        trail = np.array(rows[::-1])
        heading = trail[:, 3]
        if (
            heading.max() - heading.min() >= math.pi
        ):  # else unwrapping changes nothing, and takes longer than all the rest
            trail[:, 3] = np.unwrap(heading)
        return trail

    @abstractmethod
    def _run(self, to_s: float) -> None:
        """Let time go on."""


class Launchpad(SimulatedBoard):
    """A board that runs a model of a published sketch."""

    def __init__(
        self, wiring: Wiring, parameters: BoardParameters, seed: int, line_rate_bytes_s: float
    ) -> None:
        self.robot = wiring.robot
        self.uart = Uart(
            parameters.line_rate_bytes_s or line_rate_bytes_s,
            parameters.transmit_buffer_bytes,
            parameters.receive_buffer_bytes,
            parameters.handover_s,
        )
        self.sketch: Sketch = Sketch(wiring, parameters, self.uart, seed)
        self._program = self.sketch.run()

    def receive(self, data: bytes, at_s: float) -> None:
        """Bytes from the host; a classic sketch reads them when its next cycle begins."""
        self._run(at_s)
        self.heard_s, duty = at_s, self.sketch.duty
        self.uart.receive(data)
        self.sketch.receive(at_s)
        if self.sketch.duty != duty:
            self.duty_since_s = at_s
        self._resume_s = min(self._resume_s, self.sketch.next_s)

    def _run(self, to_s: float) -> None:
        while self._resume_s <= to_s:
            at_s, duty = self._resume_s, self.sketch.duty
            self._resume_s = next(self._program)
            if self.sketch.duty != duty:
                self.duty_since_s = at_s


STALE_S = 0.5


class BoardRunner:
    """Powers a board on at construction, and runs it at the pace of the clock.

    Lines are due at absolute times, so delays do not add up. Lines more than ``STALE_S`` late are counted and not
    sent: after a long stall the host gets the present, not minutes of the past at once. A board that is behind by more
    than ``most_behind_s`` does not make up for the rest: its time stands still meanwhile.
    """

    def __init__(
        self,
        launchpad: SimulatedBoard,
        send: Callable[[bytes], None],
        clock: Clock,
        most_behind_s: float = math.inf,
    ) -> None:
        self._launchpad, self._send, self._clock = launchpad, send, clock
        self._powered_on_s, self._most_behind_s = clock.now_s(), most_behind_s
        self.lines_skipped = 0

    @property
    def duty(self) -> tuple[int, ...]:
        """The motor command in force."""
        return self._launchpad.duty_at(self.board_s())

    @property
    def heard_s(self) -> float:
        """When the last byte from the host came in, by the board's clock (``board_s``)."""
        return self._launchpad.heard_s

    @property
    def duty_since_s(self) -> float:
        """When the motor command in force began, by the board's clock."""
        return self._launchpad.duty_since_s

    def lose_echoes(self, lost: bool) -> None:
        """Set whether the ultrasonic sensor has nothing in reach from now on, as in a large hall."""
        self._launchpad.sketch.loses_echoes = lost

    def push(self, push: Push, duration_s: float) -> None:
        """Push the robot from now on for so long."""
        now_s = self.board_s()
        self._launchpad.truth(now_s, now_s)
        self._launchpad.robot.push(push, duration_s)

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

    @property
    def terminal_v(self) -> float:
        """What a voltmeter at the battery shows."""
        return self._launchpad.robot.state.terminal_v

    def wheel_speeds_rad_s(self) -> tuple[float, ...]:
        """The true speed of each wheel now, forward positive."""
        self._launchpad.truth(self.board_s(), 0.0)
        return self._launchpad.robot.state.wheels.velocity_rad_s

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
        now_s = self._clock.now_s() - self._powered_on_s
        if self._most_behind_s < math.inf:
            missed_s = max(now_s - self._launchpad.next_event_s() - self._most_behind_s, 0.0)
            self._powered_on_s += missed_s
            now_s -= missed_s
        return now_s
