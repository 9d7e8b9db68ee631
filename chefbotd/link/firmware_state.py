"""What is known of a board with our firmware, and its report in words (docs/firmware_wire.md has the numbers)."""

import math
from collections.abc import Mapping

from chefbotd.core.events import FirmwareReported
from chefbotd.core.record import MutableState, Record
from chefbotd.core.sentence import Sentence
from firmware_protocol import messages as wire

BOARDS = {1: "atmega328p", 2: "tm4c123", 3: "lm3s6965", 4: "host"}
CAPABILITIES = {1: "wheel_loop", 2: "ultrasonic", 4: "imu", 8: "battery", 16: "motor_current"}
RESET_CAUSES = {
    1: "power_on",
    2: "reset_pin",
    3: "brown_out",
    4: "watchdog",
    5: "command",
    6: "hung_main_loop",
    7: "memory_damaged",
}
STOPS = {
    1: "dead_man",
    2: "estop",
    4: "stall",
    8: "left_wheel_lost",
    16: "right_wheel_lost",
    32: "left_encoder_storm",
    64: "right_encoder_storm",
}
LATCHED_STOPS = 127 - 1
REFUSALS = {
    1: "unknown word",
    2: "wrong number of fields",
    3: "a number is out of range",
    4: "the board is stopped",
    5: "the wheel loop is not set up",
    6: "wrong number of the e-stop",
    7: "unknown protocol",
}


def names(table: Mapping[int, str], flags: int) -> tuple[str, ...]:
    """The names of the bits that are set."""
    return tuple([name for flag, name in table.items() if flags & flag])


SMOOTHING = 0.1
"""The share of the newest round trip in the mean."""


class LineQuality(Record, frozen=True):
    """Of a connection: how long it has lasted, how many lines have come in, and how many of them damaged."""

    seconds: float
    lines: int
    damaged: int


def no_answer(heard: LineQuality, counters: wire.BoardCounters | None, hellos: int) -> str:
    """What is known of a line on which our board does not answer; ``counters`` are the board's of an earlier time."""
    percent = 100 * heard.damaged / heard.lines if heard.lines else 0.0
    if counters is None:
        return Sentence(
            "board.no_answer",
            "the cable is bad, or only one way of it is whole: the board is ours, and answered none of {hellos} hellos. "
            "Of its {lines} lines since the port was opened {damaged} came damaged ({percent:.0f} %). The motors stay "
            "off, as a line without a checksum can be a wrong command, and nothing would stop the board by itself; it "
            "is asked again every second",
            hellos=hellos,
            lines=heard.lines,
            damaged=heard.damaged,
            percent=percent,
        )
    return Sentence(
        "board.no_answer_counted",
        "the cable is bad, or only one way of it is whole: the board is ours, and answered none of {hellos} hellos. Of "
        "its {lines} lines since the port was opened {damaged} came damaged ({percent:.0f} %); the board has counted "
        "{counted} damaged lines of ours. The motors stay off, as a line without a checksum can be a wrong command, and "
        "nothing would stop the board by itself; it is asked again every second",
        hellos=hellos,
        lines=heard.lines,
        damaged=heard.damaged,
        percent=percent,
        counted=counters.crc,
    )


def no_name(heard: LineQuality) -> str:
    """What is known of a line on which a board that was ours has not named itself."""
    return Sentence(
        "board.no_name",
        "the board at this port ran our firmware when it was last heard, and has not named itself; of its "
        "{lines} lines since the port was opened {damaged} came damaged ({percent:.0f} %). The motors stay off, "
        "as a line without a checksum can be a wrong command: check the cable. Another board is driven once its "
        "lines come whole",
        lines=heard.lines,
        damaged=heard.damaged,
        percent=100 * heard.damaged / heard.lines,
    )


class FirmwareState(MutableState):
    """What is known of the board's firmware, and of the checked lines on their way to it.

    ``written_s`` has the times at which checked commands were written, by their numbers, until their echo. ``was_ours``:
    the board of an earlier connection, or of an earlier daemon, was ours. ``counters_before`` are the newest of an
    earlier checked mode.
    """

    is_checked: bool = False
    is_known: bool = False
    was_ours: bool = False
    named: wire.Firmware | None = None
    answer: wire.HelloAnswer | None = None
    board: wire.BoardState | None = None
    about: wire.BoardAbout | None = None
    about_asks: int = 0
    about_sequence: int = -1
    counters: wire.BoardCounters | None = None
    counters_before: wire.BoardCounters | None = None
    due_s: float = math.inf
    unanswered: int = 0
    hello_s: float = -math.inf
    hello_sequence: int = -1
    sequence: int = 0
    newest_command: int = -1
    echoed: int = -1
    written_s: dict[int, float] = {}
    round_trip_s: float | None = None
    clock_late_s: float | None = None
    armed: bool = False
    estopped: bool = False
    arming_until_s: float = -math.inf
    latched_s: float = -math.inf
    complaint: str = ""
    complaint_kind: str = ""

    @property
    def has_latched(self) -> bool:
        """Whether a stop is latched on the board."""
        return self.board is not None and bool(self.board.stops & LATCHED_STOPS)

    def note_round_trip(self, round_trip_s: float) -> None:
        """A line has come back after so long."""
        mean_s = round_trip_s if self.round_trip_s is None else self.round_trip_s
        self.round_trip_s = mean_s + SMOOTHING * (round_trip_s - mean_s)


def report(state: FirmwareState, now_s: float, *, lines_lost: int) -> FirmwareReported:
    """Everything that is known; ``lines_lost`` are the board's lines that did not come, or damaged."""
    named, board, counters = state.named, state.board, state.counters
    cause = board.reset_cause if board is not None else named.reset_cause if named is not None else 0
    return FirmwareReported(
        stamp_s=now_s,
        mode="checked" if state.is_checked else "classic",
        version="" if named is None else f"{named.major}.{named.minor}",
        board="" if named is None else BOARDS.get(named.board, str(named.board)),
        capabilities=names(CAPABILITIES, 0 if named is None else named.capabilities),
        deadman_ms=None if state.answer is None or not state.is_checked else state.answer.deadman_ms,
        reset_cause=RESET_CAUSES.get(cause, ""),
        stops=names(STOPS, 0 if board is None else board.stops),
        stopped_itself=state.has_latched and state.armed and now_s >= state.arming_until_s,
        crc_errors=0 if counters is None else counters.crc,
        refused=0 if counters is None else counters.refused,
        overruns=0 if counters is None else counters.overrun,
        gaps=0 if counters is None else counters.gaps,
        deadman_stops=0 if counters is None else counters.deadman,
        late_cycles=0 if counters is None else counters.late,
        lines_lost=lines_lost,
        round_trip_s=state.round_trip_s,
        clock_late_s=state.clock_late_s,
        reason=state.complaint,
        build="" if state.about is None else f"{state.about.build:04X}",
        counted_edges=None if state.about is None else state.about.edges,
        most_edges_s=None if state.about is None else state.about.most_edges_s,
    )
