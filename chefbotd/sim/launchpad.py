"""The simulated LaunchPad: the board's side of the wire, without I/O; time is an argument."""

import numpy as np

from chefbotd.core.events import TruthSimulated
from chefbotd.sim.arrays import Vector
from chefbotd.sim.peripherals import Uart
from chefbotd.sim.sketch import Sketch, Wiring
from chefbotd.sim_parameters.sketches import BoardParameters


class Launchpad:
    """A board wired to a robot, powered on at time 0. When and how often it is advanced changes nothing.

    ``sketch`` has the motor command in force, ``uart`` counts what found its receive buffer full.
    """

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
        self.sketch = Sketch(wiring, parameters, self.uart, seed)
        self._program = self.sketch.run()
        self._resume_s = 0.0

    def next_event_s(self) -> float:
        """When to call ``advance`` next: no line leaves before then."""
        return min(self.uart.next_s, self._resume_s)

    def advance(self, to_s: float) -> list[tuple[float, bytes]]:
        """Run until ``to_s``: lines that left since the last call, with the times of their last bytes."""
        self._run(to_s)
        return self.uart.take_lines(to_s)

    def receive(self, data: bytes, at_s: float) -> None:
        """Bytes from the host; the sketch reads them when its next cycle begins."""
        self._run(at_s)
        self.uart.receive(data)

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
        trail[:, 3] = np.unwrap(trail[:, 3])
        return trail

    def _run(self, to_s: float) -> None:
        while self._resume_s <= to_s:
            self._resume_s = next(self._program)
