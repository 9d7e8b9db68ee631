"""However many clients ask, a turn of the loop serves so much, in a circle, and stops and control come in between."""

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable

import pytest

from chefbotd.clock import ManualClock, run_virtual
from chefbotd.rpc.connection_manager import SLICE_S, FairScheduler
from chefbotd.rpc.session import Session
from chefbotd.transport.connection import SocketConnection
from chefbotd.transport.unread import UnreadSockets
from tests.fakes.api import new_server
from tests.fakes.transport import FakeTransport

PING = b'{"jsonrpc":"2.0","id":1,"method":"ping"}\n'
GET_STATE = b'{"jsonrpc":"2.0","id":1,"method":"get_state"}\n'
DRIVE = b'{"jsonrpc":"2.0","id":1,"method":"drive","params":{"linear_m_s":0.1,"angular_rad_s":0}}\n'
ESTOP = b'{"jsonrpc":"2.0","id":4,"method":"estop","params":{"reason":"smoke"}}\n'
ESTOPPED = ("estop", "smoke")
CLIENTS, A_TURN, PIPELINED = 100, 16, 40


class Crowd:
    """So many clients of one server, with their sockets in memory."""

    def __init__(self) -> None:
        server, self.robot, _ = new_server(requests_per_turn=A_TURN)
        self.transports: list[FakeTransport] = []
        self.connections: list[SocketConnection] = []
        for port in range(CLIENTS):
            session = server.connections.admit("127.0.0.1", 50000 + port)
            assert isinstance(session, Session)
            self.transports.append(FakeTransport())
            self.connections.append(SocketConnection(server.connections, UnreadSockets(), session))
            self.connections[-1].connection_made(self.transports[-1])
            self.transports[-1].written.clear()

    def ask(self, requests: bytes) -> None:
        """All say this within one turn of the loop, as a flood does."""
        for connection in self.connections:
            connection.data_received(requests)

    @property
    def answers(self) -> list[int]:
        """How many answers each has."""
        return [len(transport.written) for transport in self.transports]


def in_a_crowd(scenario: Callable[[Crowd], Awaitable[None]]) -> None:
    """Run a scenario with a crowd that has asked for more than two turns' worth each, and has had one turn."""

    async def main() -> None:
        crowd = Crowd()
        crowd.ask(GET_STATE * PIPELINED)
        await scenario(crowd)

    run_virtual(main())


def test_a_turn_of_the_loop_serves_so_much_however_many_ask() -> None:
    """Whoever else has something to do on the loop does it after 16 requests, not after 16 of each of 100 clients."""

    async def scenario(crowd: Crowd) -> None:
        served = 0
        while sum(crowd.answers) < CLIENTS * PIPELINED:
            assert 0 < sum(crowd.answers) - served <= A_TURN
            served = sum(crowd.answers)
            await asyncio.sleep(0)  # the control loop's turn

    in_a_crowd(scenario)


def test_an_estop_of_a_newcomer_to_the_crowd_is_carried_out_in_the_call_that_brings_it() -> None:
    """While 4000 requests of others wait: none of them is served before it."""

    async def scenario(crowd: Crowd) -> None:
        for _turn in range(3):
            await asyncio.sleep(0)
        before = sum(crowd.answers)
        crowd.connections[-1].data_received(ESTOP)
        assert (crowd.robot.calls, sum(crowd.answers)) == ([ESTOPPED], before + 1)
        assert before <= A_TURN * 4

    in_a_crowd(scenario)


def test_nor_does_one_that_comes_in_the_same_turn_as_the_crowd_wait() -> None:
    """Of the last of a hundred clients that all ask at once, behind its own requests, cut in two."""

    async def main() -> None:
        crowd = Crowd()
        crowd.ask(GET_STATE * PIPELINED + DRIVE + ESTOP[:30])
        assert (crowd.robot.calls, sum(crowd.answers)) == ([], A_TURN)
        crowd.connections[-1].data_received(ESTOP[30:])
        assert (crowd.robot.calls, sum(crowd.answers)) == ([ESTOPPED], A_TURN + 1)

    run_virtual(main())


def test_every_stop_of_a_crowd_is_seen_before_more_is_served() -> None:
    """A hundred clients that say stop behind their requests are all obeyed within the turn."""

    async def main() -> None:
        crowd = Crowd()
        crowd.ask(GET_STATE * PIPELINED + ESTOP)
        assert crowd.robot.calls == [ESTOPPED] * CLIENTS
        assert sum(crowd.answers) == A_TURN + CLIENTS

    run_virtual(main())


def test_the_crowd_is_served_in_a_circle() -> None:
    """Nobody is ahead of another by more than one request, but for who came while there was room."""

    async def scenario(crowd: Crowd) -> None:
        lucky, *others = crowd.answers
        assert lucky == A_TURN
        for _turn in range(60):
            await asyncio.sleep(0)
            _, *others = crowd.answers
            assert max(others) - min(others) <= 1
        assert min(others) > 5

    in_a_crowd(scenario)


def test_all_are_answered_in_the_end() -> None:
    """Every request, also of those who come while others wait."""

    async def scenario(crowd: Crowd) -> None:
        crowd.ask(PING * PIPELINED)
        for _turn in range(2 * CLIENTS * PIPELINED // A_TURN + 2):
            await asyncio.sleep(0)
        assert Counter(crowd.answers) == {2 * PIPELINED: CLIENTS}

    in_a_crowd(scenario)


class Costly:
    """A client whose requests take so long each, and which has no end of them."""

    def __init__(self, scheduler: FairScheduler, clock: ManualClock, cost_s: float) -> None:
        self._scheduler, self._clock, self._cost_s = scheduler, clock, cost_s
        self.served = 0

    def run_scheduled(self) -> None:
        """Serve one, and wait again."""
        self.served += 1
        self._clock.advance(self._cost_s)
        self._scheduler.add(self)


@pytest.mark.parametrize(("share", "served"), [(0.4, 3), (3.0, 1)])
def test_a_turn_ends_when_its_time_is_used_up(share: float, served: int) -> None:
    """Costly requests are fewer in a turn, and at least one."""

    async def main() -> None:
        clock = ManualClock()
        scheduler = FairScheduler(clock, requests_per_turn=1000)
        clients = [Costly(scheduler, clock, share * SLICE_S) for _ in range(3)]
        for client in clients:
            scheduler.add(client)
        for turn in range(1, 4):
            await asyncio.sleep(0)
            assert sum(client.served for client in clients) == served * turn
        assert [client.served for client in clients] == [served] * 3
        assert not scheduler.try_acquire()

    run_virtual(main())


def test_what_a_turn_has_left_is_for_who_comes_in_it() -> None:
    """Once: then the next turn of the loop has as much again."""

    async def main() -> None:
        scheduler = FairScheduler(ManualClock(), requests_per_turn=3)
        for _turn in range(2):
            assert [scheduler.try_acquire() for _ in range(5)] == [True] * 3 + [False] * 2
            await asyncio.sleep(0)

    run_virtual(main())
