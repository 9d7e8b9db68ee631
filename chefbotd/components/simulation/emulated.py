"""A simulated board that runs our firmware's own image: an ATmega328P in simavr, wired to the simulated robot.

The wheels turn the encoders, the pins of the motor drivers drive the wheels, and the sensors answer when
the program asks them. Image and robot take turns on a grid of a millisecond, so runs are the same however they are cut.
"""

from pathlib import Path

from chefbotd.components.simulation.axles import Wheels
from chefbotd.components.simulation.board import SimulatedBoard
from chefbotd.components.simulation.board_pins import BoardPins
from chefbotd.components.simulation.parameters.sketches import BoardParameters
from chefbotd.components.simulation.peripherals import Uart
from chefbotd.components.simulation.sensors import ADC_MAX
from chefbotd.components.simulation.simavr import BUILD, CYCLES_S, SimavrBoard
from chefbotd.components.simulation.sketch import Wiring

TURN_S = 0.001
FULL_SCALE = 255
ADC_MV = 5_000
"""The board's ADC compares with its supply."""


class EmulatedLaunchpad(SimulatedBoard):
    """The board, with the image that `make firmware` builds.

    Raises:
        FileNotFoundError: image or emulator is not built; the message says how.
        ValueError: the robot has not two wheels.
    """

    def __init__(
        self,
        wiring: Wiring,
        parameters: BoardParameters,
        seed: int,
        line_rate_bytes_s: float,
        folder: Path = BUILD,
    ) -> None:
        if len(wiring.chassis.wheels) != 2:
            raise ValueError(
                f"the emulated board drives two wheels, the robot has {len(wiring.chassis.wheels)}"
            )
        self.robot = wiring.robot
        self.uart = Uart(line_rate_bytes_s, ADC_MAX, ADC_MAX, parameters.handover_s)
        self.sketch = self._pins = BoardPins(wiring, seed)
        self._pins.power_imu(0.0)
        self._board = SimavrBoard(
            folder, echo_us=lambda: self._pins.read_echo_us() or 0, imu_counts=self._pins.read_imu
        )
        self._board.set_imu(self._pins.has_imu)
        self._turns, self._line = 0, bytearray()
        self._resume_s = TURN_S
        self.robot.watch(self._turn_encoders)
        self.robot.release()

    def receive(self, data: bytes, at_s: float) -> None:
        """Bytes from the host, on the wire from now on, one after the other."""
        self._run(at_s)
        self._board.receive(data, _cycle(at_s))
        self.heard_s = self._board.received_cycle / CYCLES_S

    def _run(self, to_s: float) -> None:
        while self._resume_s <= to_s:
            now_s = self._resume_s
            self._turns += 1
            self._resume_s = (self._turns + 1) * TURN_S
            self.robot.advance(now_s)
            self._measure_battery()
            self._board.run(_cycle(now_s))
            self._send_lines()
            self._drive_motors()

    def _send_lines(self) -> None:
        """The lines that are complete, each when its last byte has left."""
        for at_cycle, byte in self._board.take_bytes():
            self._line.append(byte)
            if byte == 0x0A:
                self.uart.hand_over(bytes(self._line), at_cycle / CYCLES_S)
                self._line.clear()

    def _drive_motors(self) -> None:
        for change in self._board.take_duties():
            self._pins.duty, self.duty_since_s = change.duty, change.at_cycle / CYCLES_S
            self._pins.drive([duty / FULL_SCALE for duty in change.duty])

    def _turn_encoders(self, from_s: float, to_s: float, before_rad: Wheels, after_rad: Wheels) -> None:
        wheels = zip(before_rad, after_rad, self._pins.counts_per_rad, strict=True)
        for wheel, (before, after, per_rad) in enumerate(wheels):
            if before != after:
                self._board.turn(wheel, before * per_rad, after * per_rad, _cycle(from_s), _cycle(to_s))

    def _measure_battery(self) -> None:
        self._board.set_battery_mv(round(self._pins.read_battery() / (ADC_MAX + 1) * ADC_MV))


def _cycle(at_s: float) -> int:
    return round(at_s * CYCLES_S)
