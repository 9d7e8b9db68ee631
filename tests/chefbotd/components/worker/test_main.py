"""The worker's end of the socket, without a process: what is taken before a turn goes on."""

import socket
from collections.abc import Iterator

import pytest

from chefbotd.clock import ManualClock
from chefbotd.components.worker.main import FOLLOWS_WITHIN_S, _Closed, _Inbox, _Line
from chefbotd.components.worker.messages import (
    Answer,
    FromWorker,
    Ready,
    SkillRequest,
    ToWorker,
    frame_message,
    pack_body,
)
from chefbotd.components.worker.runner import Runner

PLAN, DRIVE = (
    SkillRequest(number, "navigation", 1.0, body) for number, body in enumerate((b"plan", b"drive"))
)


class Answering(Runner):
    """Answers a plan with a result, and a drive with none."""

    def __init__(self) -> None:
        super().__init__(ManualClock())
        self.taken: list[ToWorker] = []

    def take_message(self, message: ToWorker) -> Iterator[FromWorker]:
        """Note it."""
        self.taken.append(message)
        assert isinstance(message, SkillRequest)
        yield Answer(message.id, pack_body(Ready() if message.body == b"plan" else None))


@pytest.fixture
def sockets() -> Iterator[tuple[socket.socket, socket.socket]]:
    """The daemon's and the worker's."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        yield ours, theirs


def test_the_drive_of_whoever_has_got_a_plan_is_of_the_same_turn(
    sockets: tuple[socket.socket, socket.socket],
) -> None:
    """The turn waits for it, however long the test's daemon takes: the drive is sent when the plan has been answered."""
    ours, theirs = sockets

    def answered(waiting: socket.socket, within_s: float) -> bool:
        assert ours.recv(1000)
        ours.sendall(frame_message(DRIVE))
        return within_s == FOLLOWS_WITHIN_S

    runner = Answering()
    inbox = _Inbox(theirs, _Line(theirs), runner, answered)
    ours.sendall(frame_message(PLAN))
    assert inbox.take().has_result
    inbox.take_what_follows()
    assert runner.taken == [PLAN, DRIVE]


def test_a_turn_does_not_wait_after_what_has_no_result(sockets: tuple[socket.socket, socket.socket]) -> None:
    """A drive is begun at once, and nothing is waited for where nothing has come."""
    ours, theirs = sockets
    inbox = _Inbox(theirs, _Line(theirs), Answering())
    assert inbox.take() == (False, False)
    ours.sendall(frame_message(DRIVE))
    assert inbox.take() == (True, False)


def test_the_end_of_the_daemon_is_the_end_of_what_it_sends(
    sockets: tuple[socket.socket, socket.socket],
) -> None:
    """Whether it comes before a turn or while one waits."""
    ours, theirs = sockets
    inbox = _Inbox(theirs, _Line(theirs), Answering())
    ours.close()
    with pytest.raises(_Closed):
        inbox.take()
    with pytest.raises(_Closed):
        inbox.take_what_follows()
