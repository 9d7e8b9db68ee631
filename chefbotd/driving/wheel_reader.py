"""Turns encoder frames into measured wheel motion, and chooses between wheels of one side that disagree."""

from collections.abc import Sequence

import structlog

from chefbotd.core.events import EncodersCounted
from chefbotd.core.record import MutableState, Record, StatefulPart
from chefbotd.logs import RateLimitedLog
from chefbotd.motion import encoder
from chefbotd.motion.encoder import EncoderParameters, EncodersState, Reading
from chefbotd.motion.kinematics import ChassisParameters, Kinematics
from chefbotd.motion.same_side import SameSideParameters, SameSideState, SameSideWheels

log = structlog.get_logger(component="drive")

NO_BOARD_TIME = (
    "the board sends no 't' line, so a reading has the time at which it was read, and several that come at once look "
    "like a jump: its sketch should tell the time first (docs/protocol.md)"
)


class WheelsRead(Record, frozen=True):
    """A reading, the board time since the last good one, and how the wheels of each side compare."""

    reading: Reading
    dt_s: float
    same_side: SameSideState


class WheelReaderState(MutableState):
    """The state of decoding and comparing, the board's time of the last good reading, and the refused ones."""

    encoders: EncodersState
    compared: SameSideState
    board_s: float | None = None
    refused: int = 0


class WheelReader(StatefulPart[WheelReaderState]):
    """Keeps the state of decoding and comparing from frame to frame."""

    def __init__(
        self, chassis: ChassisParameters, encoders: EncoderParameters, same_side: SameSideParameters
    ) -> None:
        self._names = tuple(wheel.name for wheel in chassis.wheels)
        self._signs = tuple(wheel.encoder_sign for wheel in chassis.wheels)
        self._parameters = encoders
        self._same_side = SameSideWheels(same_side, Kinematics(chassis), encoders.counts_per_turn)
        self.memory = WheelReaderState(encoder.START, self._same_side.start)
        self._log = RateLimitedLog(log)

    def read(self, event: EncodersCounted, setpoint_m_s: Sequence[float]) -> WheelsRead:
        """Read the next frame; ``setpoint_m_s`` are the commanded speeds of the rims since the last one."""
        memory, board_s = self.memory, event.board_s
        memory.encoders, reading = encoder.decode(
            self._parameters, self._signs, memory.encoders, event.counts, board_s, event.rate_counts_s
        )
        compared = memory.compared
        if reading.jumped or reading.unconfirmed:
            self._refuse(event, reading)
            return WheelsRead(reading, 0.0, compared)
        if reading.recognised_narrow:
            log.warning(
                "the encoders' counters wrap at 16 bits: set [encoders] width_bits = 16, or each start loses travel",
                counts=event.counts,
            )
        dt_s = 0.0 if memory.board_s is None else board_s - memory.board_s
        memory.board_s = board_s
        before = compared.substitutes
        memory.compared = compared = self._same_side.compare(compared, reading.travel_rad, setpoint_m_s, dt_s)
        if compared.substitutes and compared.substitutes != before:
            names = [self._names[index] for index in compared.excluded]
            self._log.warning("wheels disagree with their side and are excluded from odometry", wheels=names)
        return WheelsRead(reading, dt_s, compared)

    def effort(self, seen: WheelsRead, effort: tuple[float, ...]) -> tuple[float, ...]:
        """The effort of each wheel since the last frame (see ``Drive.effort``)."""
        return self._same_side.credit(seen.same_side, effort)

    def rebase(self) -> None:
        """Start again after a restart of the board, with new counters and time."""
        self.memory.encoders = encoder.rebase(self.memory.encoders)
        self.memory.board_s = None

    def _refuse(self, event: EncodersCounted, reading: Reading) -> None:
        self.memory.refused += 1
        if reading.unconfirmed:  # no fault of anyone's until the next reading has spoken
            return
        names = [self._names[index] for index in reading.jumped]
        self._log.warning(
            "impossible encoder jump refused",
            wheels=names,
            counts=event.counts,
            rebased=reading.rebased,
            **({"hint": NO_BOARD_TIME} if event.board_s == event.stamp_s else {}),
        )
