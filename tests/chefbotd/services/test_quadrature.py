"""Edges become counts on the bus."""

import asyncio

import pytest

from chefbotd.bus import Bus
from chefbotd.clock import run_virtual
from chefbotd.core.events import BoardRestarted, EdgesSeen, EncodersCounted, WheelEdge
from chefbotd.motion.quadrature import QuadratureParameters
from chefbotd.services.quadrature import QuadratureService


def counted(*heard: EdgesSeen | BoardRestarted) -> tuple[list[EncodersCounted], int]:
    """What the service of a two-wheeled robot publishes for these events, and the illegal transitions it saw."""

    async def scenario() -> tuple[list[EncodersCounted], int]:
        bus = Bus()
        inbox = bus.subscribe(EncodersCounted)
        service = QuadratureService(bus, QuadratureParameters(), wheels=2)
        task = asyncio.create_task(service.run())
        for event in heard:
            bus.publish(event)
        for _ in range(len(heard) + 1):
            await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return [inbox.take() for _ in range(len(inbox))], service.illegal_transitions

    return run_virtual(scenario())


def cycle(board_s: float, *edges: tuple[int, float, int]) -> EdgesSeen:
    """A cycle that ended at ``board_s``, read half a second later."""
    return EdgesSeen(board_s + 0.5, board_s, tuple(WheelEdge(*edge) for edge in edges))


def test_a_cycle_of_edges_is_a_reading_of_counts_and_rates():
    """Left two edges ahead 10 ms apart after its reference, right one back: (2, -1) counts; 100 counts/s left."""
    (first, second), illegal = counted(
        cycle(1.00, (0, 0.98, 0b00), (1, 0.99, 0b00)),
        cycle(1.02, (0, 1.005, 0b10), (1, 1.01, 0b01), (0, 1.015, 0b11)),
    )
    assert first == EncodersCounted(1.5, 1.0, (0, 0), (0.0, 0.0))
    assert (second.stamp_s, second.board_s, second.counts) == (1.52, 1.02, (2, -1))
    assert second.rate_counts_s == pytest.approx((100.0, 0.0))
    assert illegal == 0


def test_a_cycle_without_edges_is_a_reading_too():
    """The control loop steps by readings: wheels that stand have theirs."""
    (reading,), _ = counted(cycle(1.0))
    assert (reading.counts, reading.rate_counts_s) == ((0, 0), (0.0, 0.0))


def test_illegal_transitions_of_all_wheels_are_counted():
    """Both levels changed at once, on the left and on the right."""
    edges = ((0, 0.98, 0b00), (0, 0.99, 0b11), (1, 0.98, 0b10), (1, 0.99, 0b01))
    (reading,), illegal = counted(cycle(1.0, *edges))
    assert (reading.counts, illegal) == ((0, 0), 2)


def test_a_restarted_board_is_referenced_anew():
    """The level that the first edge after it brings is no transition from the one before."""
    (_, reading), illegal = counted(
        cycle(1.0, (0, 0.99, 0b00)), BoardRestarted(1.5, "reset"), cycle(2.0, (0, 1.99, 0b11))
    )
    assert (reading.counts, illegal) == ((0, 0), 0)
