"""The faults of motion: a stable name for each, and a reason that says what to check."""

from enum import StrEnum

from chefbotd.core.record import Record


class FaultKind(StrEnum):
    """Stable names of the faults that latch; clients branch on these."""

    LINK_LOST = "link_lost"
    BOARD_RESTARTED = "board_restarted"
    ENCODERS_SILENT = "encoders_silent"
    ENCODER_JUMPS = "encoder_jumps"
    WHEEL_STALLED = "wheel_stalled"
    WHEEL_REVERSED = "wheel_reversed"
    OVERSPEED = "overspeed"
    BOARD_UNRESPONSIVE = "board_unresponsive"
    ECHO_MISMATCH = "echo_mismatch"
    COMMANDS_LOST = "commands_lost"
    BOARD_STOPPED = "board_stopped"
    BATTERY_CRITICAL = "battery_critical"
    INTERNAL_ERROR = "internal_error"
    SERVICE_FAILED = "service_failed"
    LOOP_BLOCKED = "loop_blocked"
    UNCLEAN_SHUTDOWN = "unclean_shutdown"
    LATCH_UNWRITABLE = "latch_unwritable"


RECOVERABLE = frozenset({FaultKind.LINK_LOST, FaultKind.BOARD_RESTARTED})
"""Faults that are over when the board is back, so that ``rearm = "auto"`` may leave them; the others need a person."""

UNSTOPPED = frozenset({FaultKind.BOARD_UNRESPONSIVE})
"""Faults with which the robot may move although the gate is shut, so that they are told whatever else has latched."""


class Fault(Record, frozen=True):
    """A fault that has happened; ``reason`` is for people."""

    kind: FaultKind
    reason: str
