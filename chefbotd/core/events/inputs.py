"""Events for everything that enters the process, in order. They are published only while a recording runs.

Everything that a robot does follows from its configuration and these events. Each *entry* says what was handled, and at
which time; the robot sees this time until the next entry. The events that follow an entry on the bus are its
consequences. Events that are not entries are answers from outside.
"""

from typing import Any, ClassVar, TypeAlias

from chefbotd.core.record import Level, LogLine, Record

BOARD_LINK = "board"


class DaemonStarted(Record, frozen=True):
    """An entry, the first one. The mode of the gate is the one that the last daemon left.

    ``session`` is eight hexadecimal digits that no other start of a daemon has.
    """

    stamp_s: float
    mode: str
    reason: str
    fault: str | None
    session: str = "0"


class StateRecorded(Record, frozen=True):
    """An entry: the states of the daemon's parts, so that a replay can begin here.

    ``parts`` has the state of each part by its name, as MessagePack in base64; in an earlier version it was something
    else. ``open_links`` are the links whose port is open. ``left_out`` says what was under way, and so is missing.
    """

    stamp_s: float
    parts: dict[str, Any]
    open_links: tuple[str, ...]
    left_out: tuple[str, ...]


class DaemonStopping(Record, frozen=True):
    """The end. Events published after it belong to no entry."""

    stamp_s: float


class PortOpened(Record, frozen=True):
    """An entry: the port of a link (``board``, or ``lidar/`` and its name) was opened."""

    stamp_s: float
    link: str


class PortLost(Record, frozen=True):
    """An entry: the port of a link is gone. ``reason`` is None if the daemon closed it."""

    stamp_s: float
    link: str
    reason: str | None


class PortNotOpened(Record, frozen=True):
    """An entry: the port of a link cannot be opened."""

    stamp_s: float
    link: str
    reason: str


class PortShared(Record, frozen=True):
    """Other programs have the port open; ``sharers`` is for people, empty where nobody has any more."""

    stamp_s: float
    link: str
    sharers: str


class PortDrained(Record, frozen=True):
    """An entry: the port accepts bytes again."""

    stamp_s: float
    link: str


class LinkBytesRead(Record, frozen=True):
    """An entry: bytes came from a link, in one read."""

    recorded_as: ClassVar[str] = "/links/{link}/read"

    stamp_s: float
    link: str
    data: bytes


class LinkBytesWritten(Record, frozen=True):
    """Bytes were written to a link."""

    recorded_as: ClassVar[str] = "/links/{link}/written"

    stamp_s: float
    link: str
    data: bytes


class TimerFired(Record, frozen=True):
    """An entry: a timer is due."""

    stamp_s: float
    timer: str


class RequestHandled(Record, frozen=True):
    """An entry: a client's request is carried out. Params that hold a secret are None.

    ``number`` counts the requests and ``client`` the connections. ``name`` is what the client calls itself, ``where``
    its address. One that ``renews`` says what is carried out already, and only lets it hold for longer.
    """

    recorded_as: ClassVar[str] = "/requests"

    stamp_s: float
    number: int
    method: str
    params: dict[str, Any] | None
    client: int
    name: str
    where: str
    role: str | None
    renews: bool = False


class ClientLeft(Record, frozen=True):
    """An entry: a client is gone, and its control leases with it."""

    stamp_s: float
    client: int


class TaskStepped(Record, frozen=True):
    """An entry: a service or a long request continues until it waits again."""

    stamp_s: float
    task: str
    cancelled: bool


class ServiceFailed(Record, frozen=True):
    """An entry: a service has failed, and the robot is stopped for it."""

    stamp_s: float
    reason: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(Level.ERROR, "daemon", self.reason)


class GainsExchanged(Record, frozen=True):
    """An entry: the configuration was read again, and these are the gains by wheel."""

    stamp_s: float
    gains: dict[str, Any]


class LimitsExchanged(Record, frozen=True):
    """An entry: the configuration was read again, and these limits hold as soon as the robot stands."""

    stamp_s: float
    limits: dict[str, Any]


class EventObserved(Record, frozen=True):
    """An entry: the next event came from outside (the disk, another process, the computer)."""

    stamp_s: float


class WorkerSaid(Record, frozen=True):
    """An entry: a message of the worker, as MessagePack."""

    stamp_s: float
    message: bytes


class WorkerGone(Record, frozen=True):
    """An entry: this worker has ended."""

    stamp_s: float


class DrainAnswered(Record, frozen=True):
    """No entry: the board's port answered the ``query``-th question that all bytes are sent; before, it denied it."""

    stamp_s: float
    query: int
    drained: bool


class SetpointWithdrawn(Record, frozen=True):
    """No entry: a thread has stopped the motors without the loop, and has dropped the pending command."""

    stamp_s: float


class FaultTaken(Record, frozen=True):
    """No entry: a fault that a thread had reported was handled."""

    stamp_s: float
    kind: str
    reason: str


class AnswerTaken(Record, frozen=True):
    """No entry: a task's result from the disk, as JSON."""

    stamp_s: float
    asked: str
    answer: str


Entry: TypeAlias = (
    DaemonStarted
    | StateRecorded
    | PortOpened
    | PortLost
    | PortNotOpened
    | PortShared
    | PortDrained
    | LinkBytesRead
    | TimerFired
    | RequestHandled
    | ClientLeft
    | TaskStepped
    | ServiceFailed
    | GainsExchanged
    | LimitsExchanged
    | EventObserved
    | WorkerSaid
    | WorkerGone
)
ENTRIES: tuple[type[Entry], ...] = Entry.__args__
ANSWERS = (DrainAnswered, SetpointWithdrawn, FaultTaken, AnswerTaken)
