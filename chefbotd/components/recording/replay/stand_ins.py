"""Replacements for clients, ports and the worker in a replay."""

from collections.abc import Callable, Mapping

from chefbotd.link.port import PortTransport
from chefbotd.rpc.session import Session


class ReplayedSession(Session):
    """A client of the recording."""

    address = ""

    @property
    def where(self) -> str:
        """Its address then."""
        return self.address


class ReplayedCaller:
    """Who asked, and hears nothing."""

    def __init__(self, session: Session) -> None:
        self.session = session

    def reply(self, message: bytes, *, keep: bool = False) -> None:
        """Nobody is there."""

    def send_progress(self, message: bytes) -> None:
        """Nobody is there."""

    def send_event(self, payload: object, latest: bool) -> None:
        """Nobody is there."""

    def end(self, failure: object) -> None:
        """Nobody is there."""

    def report(self, done: float, total: float, text: str = "") -> None:
        """How far a request is: nobody is there."""


class ReplayedPort(PortTransport):
    """Takes what is written. ``queries`` says how often it was asked before whether all is sent."""

    def __init__(self, queries: Callable[[], int]) -> None:
        super().__init__()
        self._queries = queries
        self._changes: dict[int, bool] = {}
        self._drained = True

    def set_drained(self, drained: bool) -> None:
        """The answer to come, until the recording has another."""
        self._drained = drained

    def expect(self, changes: Mapping[int, bool]) -> None:
        """The answers of the recording, by the number of the query from which on each holds."""
        self._changes.update(changes)

    def get_write_buffer_size(self) -> int:
        """As it was in the recording."""
        self._drained = self._changes.pop(self._queries() + 1, self._drained)
        return 0 if self._drained else 1

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """It goes nowhere."""

    def is_closing(self) -> bool:
        """Its end is in the recording."""
        return False

    def close(self) -> None:
        """Its end is in the recording."""

    def abort(self) -> None:
        """Its end is in the recording."""


class UnheardProgress:
    """Hears how far a request is."""

    def report(self, done: float, total: float, text: str = "") -> None:
        """Nobody is there."""
