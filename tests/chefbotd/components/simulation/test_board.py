"""The simulated board in an event loop, on virtual time."""

import asyncio

import pytest

from chefbotd.clock import Clock, LoopClock, ManualClock, run_virtual
from chefbotd.components.simulation.board import BoardRunner, Launchpad
from chefbotd.components.simulation.simulation import Simulation, build_launchpad


def a_launchpad() -> Launchpad:
    """The default board."""
    return build_launchpad(Simulation())


class Host:
    """The far end: keeps what arrives, with the time."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.heard: list[tuple[float, bytes]] = []

    def receive(self, data: bytes) -> None:
        """Take bytes from the board."""
        self.heard.append((self._clock.now_s(), data))


def test_lines_are_sent_when_they_leave_the_board() -> None:
    """On the loop's clock every line is sent at the time at which a board left alone emits it."""

    async def scenario() -> tuple[list[tuple[float, bytes]], float]:
        clock = LoopClock()
        host, started_s = Host(clock), clock.now_s()
        runner = BoardRunner(a_launchpad(), host.receive, clock)
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(runner.run(), 2.0)
        return host.heard, started_s

    heard, started_s = run_virtual(scenario())
    expected = a_launchpad().advance(1.99)
    assert b"".join(data for _, data in heard).startswith(b"".join(line for _, line in expected))
    for (heard_s, _), (left_s, _) in zip(heard, expected, strict=False):
        assert heard_s - started_s == pytest.approx(left_s, abs=1e-6)


def test_commands_reach_the_board_and_move_the_robot() -> None:
    """A command given after a second is in force soon after, and the truth shows the motion."""

    async def scenario() -> None:
        host = Host(LoopClock())
        runner = BoardRunner(a_launchpad(), host.receive, LoopClock())
        task = asyncio.create_task(runner.run())
        await asyncio.wait({task}, timeout=1.0)
        runner.receive(b"s 400 400\r")
        await asyncio.wait({task}, timeout=1.0)
        assert runner.duty == (400, 400)
        truth = runner.truth(stamp_s=42.0)
        assert truth.stamp_s == 42.0
        assert truth.twist.linear_m_s > 0.1
        task.cancel()

    run_virtual(scenario())


def test_after_a_stall_the_host_gets_the_present() -> None:
    """When the process stood still for a minute, only the last half second is sent; the rest is counted."""

    async def scenario() -> None:
        clock = ManualClock()
        host = Host(clock)
        runner = BoardRunner(a_launchpad(), host.receive, clock)
        clock.advance(60.0)
        task = asyncio.create_task(runner.run())
        await asyncio.wait({task}, timeout=0.001)
        task.cancel()
        sent = b"".join(data for _, data in host.heard)
        micros = [int(line.split(b"\t")[1]) for line in sent.split(b"\n") if line.startswith(b"t\t")]
        assert micros[0] >= 59_400_000
        assert micros[-1] <= 60_000_000
        assert runner.lines_skipped > 59 * 19 * 5  # at 20 Hz, at least five lines a cycle

    run_virtual(scenario())


def test_commands_in_a_stall_do_not_turn_time_back() -> None:
    """A command that arrives behind what was already simulated is taken as arriving now."""

    async def scenario() -> None:
        clock = ManualClock(5.0)
        host = Host(clock)
        runner = BoardRunner(a_launchpad(), host.receive, clock)
        clock.advance(2.0)
        runner.truth(stamp_s=0.0)
        runner.receive(b"s 9 9\r")
        clock.advance(0.1)
        runner.truth(stamp_s=0.0)
        assert runner.duty == (9, 9)

    run_virtual(scenario())


def test_a_board_that_may_not_catch_up_has_stood_still_meanwhile() -> None:
    """A minute in which nothing was computed adds 50 ms to its time, and a second in which it was adds a second."""
    clock, launchpad = ManualClock(), a_launchpad()
    runner = BoardRunner(launchpad, lambda data: None, clock, most_behind_s=0.05)
    due_s = launchpad.next_event_s()
    clock.advance(60.0)
    assert runner.board_s() == pytest.approx(due_s + 0.05)
    for _ in range(100):
        launchpad.advance(runner.board_s())
        clock.advance(0.01)
    assert runner.board_s() == pytest.approx(due_s + 1.05)


def test_the_board_says_when_it_heard_and_when_its_duty_began() -> None:
    """A command at 1 s of a board that reads once a cycle of 50 ms: in force within two; the stop later likewise."""
    launchpad = a_launchpad()
    launchpad.advance(1.0)
    launchpad.receive(b"s 400 400\r", 1.0)
    launchpad.advance(2.0)
    assert launchpad.heard_s == 1.0
    assert 1.0 <= launchpad.duty_since_s <= 1.1
    launchpad.receive(b"s 0 0\r", 2.0)
    launchpad.advance(3.0)
    assert launchpad.heard_s == 2.0
    assert 2.0 <= launchpad.duty_since_s <= 2.1
