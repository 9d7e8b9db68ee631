"""Edges become counts on the bus."""

import asyncio
from dataclasses import dataclass

import pytest
from structlog.testing import capture_logs

from chefbotd.bus import Bus
from chefbotd.clock import run_virtual
from chefbotd.core.events import BoardRestarted, EdgeBurst, EdgesSeen, EncodersCounted
from chefbotd.motion.edge_speed import QuadratureParameters
from chefbotd.services.quadrature import QuadratureService


@dataclass
class Outcome:
    """What the service published, counted and logged."""

    readings: list[EncodersCounted]
    illegal: int
    repeated: int
    lost: int
    warnings: list[dict[str, object]]


def counted(*heard: EdgesSeen | BoardRestarted) -> Outcome:
    """What the service of a two-wheeled robot makes of these events."""

    async def scenario() -> Outcome:
        bus = Bus()
        inbox = bus.subscribe(EncodersCounted)
        service = QuadratureService(bus, QuadratureParameters(), ("left", "right"))
        task = asyncio.create_task(service.run())
        with capture_logs() as warnings:
            for event in heard:
                bus.publish(event)
            for _ in range(len(heard) + 1):
                await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        readings = [inbox.take() for _ in range(len(inbox))]
        return Outcome(
            readings, service.illegal_transitions, service.repeated_levels, service.lost_edges, warnings
        )

    return run_virtual(scenario())


def burst(wheel: int, total: int, *edges: tuple[float, int]) -> EdgeBurst:
    """Edges (time, levels) of a wheel; the last is its ``total``-th."""
    times_s, levels = zip(*edges, strict=True)
    return EdgeBurst(wheel, total, levels, times_s)


def cycle(board_s: float, *bursts: EdgeBurst) -> EdgesSeen:
    """A cycle that ended at ``board_s``, read half a second later."""
    return EdgesSeen(board_s + 0.5, board_s, bursts)


BEGUN = cycle(1.00, burst(0, 1, (0.98, 0b00)), burst(1, 1, (0.99, 0b00)))


def test_a_cycle_of_edges_is_a_reading_of_counts_and_rates():
    """Left two edges ahead 10 ms apart after its reference, right one back: (2, -1) counts; 100 counts/s left."""
    ahead, back = burst(0, 3, (1.005, 0b10), (1.015, 0b11)), burst(1, 2, (1.01, 0b01))
    outcome = counted(BEGUN, cycle(1.02, ahead, back))
    first, second = outcome.readings
    assert first == EncodersCounted(1.5, 1.0, (0, 0), (0.0, 0.0))
    assert (second.stamp_s, second.board_s, second.counts) == (1.52, 1.02, (2, -1))
    assert second.rate_counts_s == pytest.approx((100.0, 0.0))
    assert (outcome.illegal, outcome.repeated, outcome.lost, outcome.warnings) == (0, 0, 0, [])


def test_a_cycle_may_have_several_bursts_of_a_wheel():
    """Two lines of the left wheel's edges: four counts."""
    lines = burst(0, 3, (1.005, 0b10), (1.01, 0b11)), burst(0, 5, (1.012, 0b01), (1.015, 0b00))
    assert counted(BEGUN, cycle(1.02, *lines)).readings[-1].counts == (4, 0)


def test_a_cycle_without_edges_is_a_reading_too():
    """The control loop steps by readings: wheels that stand have theirs."""
    (reading,) = counted(cycle(1.0)).readings
    assert (reading.counts, reading.rate_counts_s) == ((0, 0), (0.0, 0.0))


def test_odd_transitions_of_all_wheels_are_counted():
    """Both levels changed at once on the left and on the right, and once nothing changed: three oddities, no motion."""
    left = burst(0, 3, (1.005, 0b11), (1.01, 0b11))
    outcome = counted(BEGUN, cycle(1.02, left, burst(1, 2, (1.01, 0b11))))
    assert (outcome.illegal, outcome.repeated, outcome.lost) == (2, 1, 0)
    assert outcome.readings[-1].counts == (0, 0)


def test_a_cycle_that_lacks_edges_is_no_reading_and_the_next_is():
    """Five edges of the right wheel were dropped: no reading for either, told once by name; then counting goes on."""
    short = cycle(1.02, burst(0, 3, (1.005, 0b10), (1.015, 0b11)), burst(1, 7, (1.01, 0b10)))
    outcome = counted(BEGUN, short, cycle(1.04, burst(1, 8, (1.03, 0b11))))
    first, after = outcome.readings
    assert (first.board_s, after.board_s, after.counts) == (1.0, 1.04, (2, 1))
    assert outcome.lost == 5
    (warning,) = outcome.warnings
    assert (warning["event"], warning["edges"]) == (
        "edges of the encoders were lost: no reading",
        {"right": 5},
    )


def test_a_restarted_board_is_referenced_anew():
    """Levels and total that the first edge after it brings are no transition from those before, and no loss."""
    outcome = counted(
        cycle(1.0, burst(0, 900, (0.99, 0b00))),
        BoardRestarted(1.5, "reset"),
        cycle(2.0, burst(0, 1, (1.99, 0b11))),
    )
    assert (outcome.readings[-1].counts, outcome.illegal, outcome.lost) == ((0, 0), 0, 0)
