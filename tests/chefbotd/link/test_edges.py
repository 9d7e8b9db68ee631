"""Edge lines become dated edges, a cycle at a time."""

import asyncio

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import ManualClock, run_virtual
from chefbotd.core.events import AnalogueCounted, EdgeBurst, EdgesSeen, EncodersCounted
from chefbotd.link.board_clock import BoardClock
from chefbotd.link.board_reader import MOST_BURSTS, BurstBuffer
from chefbotd.link.session import BoardSession
from chefbotd.testing.transport import FakeSerialTransport
from firmware_protocol.codec import KHAN, KHAN_EDGES, Variant
from firmware_protocol.messages import QuadratureEdges


def heard(variant: Variant, *chunks: bytes) -> list[EdgesSeen | AnalogueCounted]:
    """The events of chunks that are read 20 ms apart, from host time 100 s."""

    async def scenario() -> list[EdgesSeen | AnalogueCounted]:
        bus, clock = Bus(), ManualClock(100.0)
        inbox = bus.subscribe(EdgesSeen, AnalogueCounted, EncodersCounted)
        session = BoardSession(bus, clock, variant, device="test", setpoints_per_s=200.0)
        FakeSerialTransport(session, lambda data: None)
        await asyncio.sleep(0)
        for chunk in chunks:
            session.data_received(chunk)
            clock.advance(0.02)
        return [inbox.take_event() for _ in range(len(inbox))]

    return run_virtual(scenario())


def test_edges_wait_for_the_time_that_closes_their_cycle():
    """Two bursts and ``t``: one event, dated against ``t``, whose 20,000 µs are board time 100.02 s."""
    first, second = heard(
        KHAN_EDGES,
        b"t\t1000000\t0.02\n",
        b"q\t2\t7\t8\t1010000\t500\nq\t0\t3\tj\t1012000\nt\t1020000\t0.02\n",
    )
    assert first == EdgesSeen(100.0, 100.0, 100.0, ())
    assert (second.stamp_s, second.board_s) == (100.02, pytest.approx(100.02))
    two, none = second.bursts
    assert (two.wheel, two.total, two.levels) == (2, 7, (2, 3))
    assert two.times_s == pytest.approx((100.0095, 100.010))
    assert (none.wheel, none.total, none.levels) == (0, 3, (2, 3, 1))
    assert none.times_s == pytest.approx((100.012,))


def test_a_wheel_without_edges_is_told_all_the_same():
    """Its line has a total and nothing more."""
    _, told = heard(KHAN_EDGES, b"t\t1000000\t0.02\n", b"q\t3\t7\nt\t1020000\t0.02\n")
    assert told.bursts == (EdgeBurst(3, 7, (), ()),)


def test_edges_are_dated_across_the_wrap_of_the_boards_counter():
    """An edge 5 ms before the wrap and one 5 ms after it are 10 ms apart."""
    *_, seen = heard(
        KHAN_EDGES,
        b"t\t4294957296\t0.02\n",
        b"q\t0\t2\t8\t5000\t10000\nt\t10000\t0.02\n",
    )
    (burst,) = seen.bursts
    before_s, after_s = burst.times_s
    assert after_s - before_s == pytest.approx(0.010)
    assert seen.board_s - after_s == pytest.approx(0.005)


def test_a_time_in_doubt_keeps_the_edges_for_the_next_cycle():
    """A damaged ``t`` closes nothing; the next good one has the edges of both cycles."""
    events = heard(
        KHAN_EDGES,
        b"t\t1000000\t0.02\n",
        b"q\t0\t1\t+\t1010000\nt\t91020000\t0.02\n",
        b"q\t0\t2\t,\t1030000\nt\t1040000\t0.02\n",
    )
    assert [[burst.total for burst in event.bursts] for event in events] == [[], [1, 2]]


def test_edges_of_a_board_that_then_restarted_are_forgotten():
    """What was told before the banner belongs to another run of the clock."""
    events = heard(
        KHAN_EDGES,
        b"t\t1000000\t0.02\n",
        b"q\t0\t9\t+\t1010000\nMPU6050 connection successful\r\nq\t0\t1\t,\t150000\nt\t160000\t0.02\n",
    )
    (burst,) = events[-1].bursts
    assert (burst.total, burst.levels) == (1, (3,))


def test_a_board_that_counts_itself_closes_no_cycles_of_edges():
    """``t`` of KHAN's usual board is a time and nothing else; its analogue line is a raw reading."""
    assert heard(KHAN, b"t\t1000000\t0.02\n", b"a\t3\t2048.00\n") == [
        AnalogueCounted(100.02, 100.02, 3, 2048.0)
    ]


def test_edges_that_no_time_follows_are_kept_within_bounds():
    """Twice as many bursts as there is room for: the newest remain."""
    clock = BoardClock()
    clock.observe(0, 0.0, 50.0)
    buffer = BurstBuffer(clock)
    for n in range(2 * MOST_BURSTS):
        buffer.put(QuadratureEdges(0, n, (2,), n))
    bursts = buffer.empty()
    assert [burst.total for burst in bursts] == list(range(MOST_BURSTS, 2 * MOST_BURSTS))
    assert bursts[-1].times_s == pytest.approx((50.0 + (2 * MOST_BURSTS - 1) * 1e-6,))
    assert buffer.empty() == ()


def test_edges_before_any_time_cannot_be_dated():
    """A clock that was never read gives no times, so there are no edges."""
    buffer = BurstBuffer(BoardClock())
    buffer.put(QuadratureEdges(0, 1, (2,), 5))
    assert buffer.empty() == ()


def test_the_gaps_lead_back_from_the_last_edge():
    """Four edges, the last 7 µs after the clock was read, 20 and 10 µs between the last three: the first has no time."""
    clock = BoardClock()
    clock.observe(100, 0.0, 50.0)
    buffer = BurstBuffer(clock)
    buffer.put(QuadratureEdges(3, 9, (2, 3, 1, 0), 107, (10, 20)))
    (burst,) = buffer.empty()
    assert (burst.wheel, burst.total, burst.levels) == (3, 9, (2, 3, 1, 0))
    assert burst.times_s == pytest.approx((49.999977, 49.999987, 50.000007), abs=1e-9)


def test_counts_from_a_board_that_sends_edges_are_no_reading():
    """A wheel has one encoder: on this wire ``e`` is text."""
    assert heard(KHAN_EDGES, b"t\t1000000\t0.02\n", b"e\t1\t2\t3\t4\n") == [
        EdgesSeen(100.0, 100.0, 100.0, ())
    ]
