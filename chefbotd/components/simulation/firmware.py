"""A simulated board that runs our own firmware: its core, compiled for this computer, wired to the simulated robot.

The program's time goes on from one step of the robot to the next, between which the wheels turn evenly; what it does
there happens at its own microsecond. It takes received bytes at once, as the real one does within a millisecond.
"""

import math

from chefbotd.components.simulation.board import SimulatedBoard
from chefbotd.components.simulation.board_pins import BoardPins
from chefbotd.components.simulation.compiled_firmware import CompiledFirmware
from chefbotd.components.simulation.parameters.sketches import UINT32_SPAN, BoardParameters
from chefbotd.components.simulation.peripherals import Uart, pwm_share
from chefbotd.components.simulation.sketch import Wiring

SOFTWARE, POWER_ON = 0, 1
"""Why the program starts; after a restart by software it knows itself."""

IMU_S, BATTERY_S = 0.02, 0.2
"""How often the board's sensors have a new reading."""

ECHO_BEGINS_US = 450
"""An HC-SR04 sends its burst before it raises its line (assumed)."""


class FirmwareBoard(SimulatedBoard):
    """The board, powered on at time 0.

    Raises:
        OSError: there is no compiled core; the message says what to do.
    """

    def __init__(
        self, wiring: Wiring, parameters: BoardParameters, seed: int, line_rate_bytes_s: float
    ) -> None:
        rate_bytes_s = parameters.line_rate_bytes_s or line_rate_bytes_s
        self.robot, self._parameters = wiring.robot, parameters
        self.uart = Uart(
            rate_bytes_s,
            parameters.transmit_buffer_bytes,
            parameters.receive_buffer_bytes,
            parameters.handover_s,
        )
        self.sketch = self._pins = BoardPins(wiring, seed)
        self._program = CompiledFirmware(1e6 / rate_bytes_s)
        self._program.hal.has_imu = self._pins.has_imu
        self._pings = self._restarts = 0
        self._now_s, self._steps = 0.0, 0
        self._starts_s = self._resume_s = _whole_us(parameters.boot_s)
        self._cause = POWER_ON
        self._micros = parameters.boot_micros + round(parameters.boot_s * 1e6)
        self._imu_steps, self._battery_steps = [
            max(round(period_s / self.robot.step_s), 1) for period_s in (IMU_S, BATTERY_S)
        ]
        self.robot.release()

    def receive(self, data: bytes, at_s: float) -> None:
        """Bytes from the host."""
        self._run(at_s)
        self.heard_s = at_s
        self.uart.receive(data)
        self._program.receive(self.uart.read())
        self._serve_hardware(round(at_s * 1e6))
        self._note_next()

    def _run(self, to_s: float) -> None:
        to_s = _whole_us(to_s)
        while self._now_s < to_s:
            step_ends_s = (self._steps + 1) * self.robot.step_s
            self._now_s = min(step_ends_s, self._starts_s, to_s)
            self.robot.advance(self._now_s)
            self._run_program()
            if self._now_s == self._starts_s:
                self._start()
            if self._now_s == step_ends_s:
                self._steps += 1
                self._read_sensors()
            self._note_next()

    def _note_next(self) -> None:
        self._resume_s = self._program.next_us / 1e6 if self._starts_s == math.inf else self._starts_s

    def _start(self) -> None:
        self._pins.power_imu(self._now_s)
        self._program.start(self._cause, self._micros % UINT32_SPAN)
        self._starts_s = math.inf
        self._apply_duty()

    def _run_program(self) -> None:
        to_us, counts, at_us = round(self._now_s * 1e6), self._pins.read_counts(), -1
        while at_us < to_us:
            at_us = self._program.run(to_us, counts)
            self._serve_hardware(at_us)
        for left_us, line in self._program.take_lines():
            self.uart.hand_over(line, left_us / 1e6)

    def _serve_hardware(self, at_us: int) -> None:
        """Do what the program has asked its hardware for, at this time."""
        hal = self._program.hal
        duty = hal.duty[0], hal.duty[1]
        if duty != self._pins.duty:
            self._pins.duty, self.duty_since_s = duty, self._program.duty_since_us / 1e6
            self._apply_duty()
        if hal.pings != self._pings:
            self._pings = hal.pings
            if (echo_us := self._pins.read_echo_us()) is not None:
                rises_us = at_us + ECHO_BEGINS_US
                self._program.echo(rises_us, rises_us + echo_us)
        if hal.restarts != self._restarts:
            self._restarts, self._cause = hal.restarts, SOFTWARE
            self._starts_s = _whole_us(at_us / 1e6 + self._parameters.boot_s)
            self._micros = round(self._parameters.boot_s * 1e6)
            self.robot.release()

    def _apply_duty(self) -> None:
        law, full_scale = self._parameters.pwm_law, self._parameters.pwm_full_scale
        self._pins.drive([pwm_share(law, full_scale, value) for value in self._pins.duty])

    def _read_sensors(self) -> None:
        hal = self._program.hal
        is_running = self._starts_s == math.inf
        if is_running and self._pins.has_imu and self._steps % self._imu_steps == 0:
            hal.imu[:], hal.imu_us, hal.is_new_imu = self._pins.read_imu(), hal.micros, True
        if self._steps % self._battery_steps == 0:
            hal.battery, hal.is_new_battery = self._pins.read_battery(), True


def _whole_us(at_s: float) -> float:
    """The program's time has whole microseconds."""
    return round(at_s * 1e6) / 1e6
