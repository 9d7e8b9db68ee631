"""The board: its link, its restart, and the log of lines around a fault."""

from collections.abc import Callable

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.sentence import Sentence
from chefbotd.driving.board.models import TOPICS
from chefbotd.features.feature import Feature, Service
from chefbotd.link.board_writer import FaultLog
from chefbotd.link.reconnect import PortLink
from chefbotd.link.session import BoardSession
from chefbotd.metrics import Metrics
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import DONE, Done, NoParams
from chefbotd.rpc.parameters import Role


class BoardService:
    """Restarts the board after ``brake`` has stopped the motors and forgotten every command."""

    def __init__(self, session: BoardSession, brake: Callable[[], None]) -> None:
        self._session, self._brake = session, brake

    @method(role=Role.ADMIN, moves=False)
    def reset_board(self, caller: Caller, params: NoParams) -> Done:
        """Restart the board; its counters start at zero."""
        if not self._session.is_open:
            raise Refused(
                RefusalKind.LINK_DOWN, Sentence("board.not_connected", "the board is not connected")
            )
        self._brake()
        self._session.reset_board()
        return DONE


def board(session: BoardSession, link: PortLink, fault_log: FaultLog, brake: Callable[[], None]) -> Feature:
    """The feature for a session with the board; ``brake`` stops the motors and forgets every command."""
    return Feature(
        "board",
        services=(Service("fault log", fault_log.run), Service("link", link.run, critical=True)),
        methods=methods_of(BoardService(session, brake)),
        topics=TOPICS,
        add_metrics=lambda metrics: _add_metrics(metrics, session),
    )


def _add_metrics(metrics: Metrics, session: BoardSession) -> None:
    clock = session.board_clock
    metrics.counter("bytes_in", "Bytes from the board.", lambda: session.monitor.memory.bytes_in)
    metrics.counters("frames", "Accepted lines from the board.", "message", lambda: session.frames)
    metrics.counters("refused", "Malformed lines from the board.", "reason", lambda: session.refused)
    metrics.counter("lines_out", "Lines to the board.", lambda: session.writer.memory.lines_out)
    metrics.counter(
        "setpoints_replaced",
        "Duties that newer ones replaced before they were sent.",
        lambda: session.setpoints.replaced,
    )
    metrics.counter("link_opens", "Connections of the serial port.", lambda: session.memory.opens)
    metrics.counter("board_restarts", "Restarts of the board.", lambda: session.restarts.memory.count)
    metrics.counter(
        "board_lines_lost", "Checked lines of the board that were lost.", lambda: session.firmware.codec.lost
    )
    metrics.optional_gauge(
        "board_round_trip_s",
        "From a checked command to its echo, on average.",
        lambda: session.firmware.memory.round_trip_s,
    )
    metrics.optional_gauge(
        "board_clock_late_s",
        "By how much later than they were taken the board's readings are stamped.",
        lambda: session.firmware.memory.clock_late_s,
    )
    metrics.optional_gauge(
        "board_clock_skew_ppm", "The board's clock against the host's.", lambda: clock.relation.skew_ppm
    )
    metrics.optional_gauge(
        "board_clock_jitter_s",
        "Scatter of the arrival times about the board's clock.",
        lambda: clock.relation.jitter_s,
    )
    metrics.counter(
        "board_clock_suspects", "Timestamps of the board that were rejected.", lambda: clock.suspects
    )
