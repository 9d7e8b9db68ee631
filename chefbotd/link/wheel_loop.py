"""Drives by the board's own wheel loop, where the configuration asks for it and the board has one.

The gate, the limits and the ramps stay here: what goes out is each wheel's setpoint in place of its duty. The detectors
judge the duty that the controller here would have given, by the number of the command that the board obeys.
"""

import math
from collections.abc import Callable, Sequence

from chefbotd.core.record import MutableState, Record, StatefulPart
from chefbotd.motion.kinematics import ChassisParameters
from chefbotd.motion.pid import PidParameters

Command = tuple[int, ...]
"""A duty, or a speed in mrad/s, of each wheel."""

FRACTION = 256
"""The board's gains are in 1/256 of a duty."""

MOST_GAIN, MOST_INTEGRAL_GAIN, MOST_FRICTION = 20_000, 500_000, 65_280
"""What the board takes: `g` 1 and 3, 2, 4 in docs/firmware_wire.md."""

MOST_MRAD_S = 50_000
TURN_MRAD = 6283
CAPABILITY = 1
ASK_AGAIN_S = 0.3


class WheelLoopParameters(Record, frozen=True):
    """What the board is told, by the parameters' numbers, and the sign of each wheel's motor."""

    values: tuple[int, ...]
    signs: tuple[int, ...]


def wheel_loop_parameters(
    chassis: ChassisParameters, counts_per_turn: float, gains: Sequence[PidParameters]
) -> WheelLoopParameters:
    """The board's parameters: counts a turn, kp, ki, kv, ks, of all wheels alike (their means).

    Raises:
        ValueError: a wheel's motor and encoder have different signs, which the board cannot know.
    """
    if any(wheel.motor_sign != wheel.encoder_sign for wheel in chassis.wheels):
        raise ValueError("the board's wheel loop needs motors and encoders with the same sign")
    rims_m = [wheel.radius_m for wheel in chassis.wheels]
    pairs = list(zip(gains, rims_m, strict=True))

    def scaled(values: Sequence[float], most: int) -> int:
        return min(round(FRACTION * sum(values) / len(values)), most)

    return WheelLoopParameters(
        (
            round(counts_per_turn),
            scaled([gain.kp * rim_m for gain, rim_m in pairs], MOST_GAIN),
            scaled([gain.ki * rim_m for gain, rim_m in pairs], MOST_INTEGRAL_GAIN),
            scaled([gain.kv * rim_m for gain, rim_m in pairs], MOST_GAIN),
            scaled([gain.ks for gain in gains], MOST_FRICTION),
        ),
        tuple([wheel.motor_sign for wheel in chassis.wheels]),
    )


class WheelLoopState(MutableState):
    """Which parameters the board has confirmed, by their numbers, and which duty stood behind each command.

    ``sent`` has command and duty by the number of the line, ``offered`` the newest pair. ``by_duty``: the wheels are
    driven by duties now, past the loop. ``most_edges_s`` is how many edges of a wheel the board counts in a second.
    """

    confirmed: dict[int, int] = {}
    asked_s: float = -math.inf
    is_ready: bool = False
    by_duty: bool = False
    offered: tuple[Command, Command] | None = None
    written_duty: Command = ()
    sent: dict[int, tuple[Command, Command]] = {}
    most_edges_s: int | None = None


class WheelLoop(StatefulPart[WheelLoopState]):
    """Not wanted until ``use`` is called; ready when the board has confirmed each parameter.

    Parameters that change later follow one by one, while the board drives on.
    """

    def __init__(self) -> None:
        self._parameters = WheelLoopParameters((), ())
        self._targets_rad_s: Callable[[], tuple[float, ...] | None] = tuple
        self.is_wanted = False
        self.memory = WheelLoopState()

    def use(
        self, parameters: WheelLoopParameters, targets_rad_s: Callable[[], tuple[float, ...] | None]
    ) -> None:
        """Drive by the board's loop wherever it has one.

        ``targets_rad_s`` are the wheels' present setpoints; None where duties are commanded, as by a calibration.
        """
        self._parameters, self._targets_rad_s, self.is_wanted = parameters, targets_rad_s, True

    def change(self, parameters: WheelLoopParameters) -> None:
        """The board is to drive by other parameters from now on."""
        self._parameters = parameters

    def limit_edges(self, most_edges_s: int) -> None:
        """The board counts no more edges of a wheel a second than these: it refuses a speed that would have more."""
        self.memory.most_edges_s = most_edges_s

    @property
    def _most_mrad_s(self) -> int:
        if self.memory.most_edges_s is None:
            return MOST_MRAD_S
        return min(MOST_MRAD_S, self.memory.most_edges_s * TURN_MRAD // self._parameters.values[0])

    def reset(self) -> None:
        """The board knows no parameters: it is another one, or has another mode."""
        self.memory = WheelLoopState(most_edges_s=self.memory.most_edges_s)

    # Set up

    def next_parameter(self, now_s: float) -> tuple[int, int] | None:
        """The parameter that is to be sent now, if any."""
        now, number = self.memory, self._next_number()
        if number is None or now_s - now.asked_s < ASK_AGAIN_S:
            return None
        now.asked_s = now_s
        return number, self._parameters.values[number]

    def _next_number(self) -> int | None:
        """The first parameter that the board does not have; None: it has all."""
        confirmed = self.memory.confirmed
        for number, value in enumerate(self._parameters.values):
            if confirmed.get(number) != value:
                return number
        return None

    def confirm(self, parameter: int, value: int) -> bool:
        """The board has a parameter; whether that makes the loop ready."""
        now = self.memory
        if not self.is_wanted or parameter != self._next_number():
            return False
        now.confirmed[parameter], now.asked_s = value, -math.inf
        if now.is_ready or self._next_number() is not None:
            return False
        now.is_ready = True
        return True

    # Commands

    @property
    def drives(self) -> bool:
        """Whether a command is a speed of each wheel."""
        return self.memory.is_ready and not self.memory.by_duty

    def changes_over(self) -> bool:
        """Whether the wheels are driven by duties from now on, or not any more: a command that waits is none now."""
        before, self.memory.by_duty = self.memory.by_duty, self._targets_rad_s() is None
        return self.memory.by_duty is not before

    def command(self, duty: Command) -> Command:
        """The wheels' setpoints in mrad/s, in the place of this duty; no duty is a stop."""
        speeds, targets_rad_s = duty, self._targets_rad_s()
        if any(duty) and targets_rad_s is not None:
            wheels, most = zip(targets_rad_s, self._parameters.signs, strict=True), self._most_mrad_s
            limited = [(max(-most, min(most, round(1000 * speed))), sign) for speed, sign in wheels]
            speeds = tuple([sign * speed for speed, sign in limited])
        self.memory.offered = speeds, duty
        return speeds

    def note_sent(self, number: int) -> None:
        """The newest command goes out as the line of this number."""
        if self.drives and self.memory.offered is not None:
            self.memory.sent[number] = self.memory.offered
        else:
            self.memory.sent.pop(number, None)

    def duty_of(self, command: Command) -> Command:
        """The duty that stood behind a command."""
        offered = self.memory.offered
        return offered[1] if offered is not None and offered[0] == command else self.memory.written_duty

    def obeyed(self, of: int, duty: Command) -> tuple[Command, Command]:
        """The command and the duty behind it that the board obeys when it says so: its own duty is the loop's."""
        return self.memory.sent.get(of, (duty, duty)) if any(duty) else (duty, duty)
