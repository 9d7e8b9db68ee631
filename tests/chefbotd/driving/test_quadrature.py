"""Edges become counts on the bus."""

import asyncio
from dataclasses import dataclass

import pytest
from structlog.testing import capture_logs

from chefbotd.bus import Bus
from chefbotd.clock import run_virtual
from chefbotd.core.events import BoardRestarted, EdgeBurst, EdgesSeen, EncodersCounted
from chefbotd.driving.quadrature import QuadratureService
from chefbotd.motion.edge_speed import QuadratureParameters


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
        readings = [inbox.take_event() for _ in range(len(inbox))]
        return Outcome(
            readings, service.illegal_transitions, service.repeated_levels, service.lost_edges, warnings
        )

    return run_virtual(scenario())


def burst(wheel: int, total: int, *edges: tuple[float, int]) -> EdgeBurst:
    """Edges (time, levels) of a wheel; the last is its ``total``-th."""
    return EdgeBurst(wheel, total, tuple(levels for _, levels in edges), tuple(at_s for at_s, _ in edges))


def cycle(board_s: float, *bursts: EdgeBurst) -> EdgesSeen:
    """A cycle that ended at ``board_s``, read half a second later."""
    return EdgesSeen(board_s + 0.5, board_s + 0.6, board_s, bursts)


BEGUN = cycle(1.00, burst(0, 1, (0.98, 0b00)), burst(1, 1, (0.99, 0b00)))
LEFT_STANDS, RIGHT_STANDS = burst(0, 1), burst(1, 1)


def test_a_cycle_of_edges_is_a_reading_of_counts_and_rates():
    """Left two edges ahead 10 ms apart after its reference, right one back: (2, -1) counts; 100 counts/s left."""
    ahead, back = burst(0, 3, (1.005, 0b10), (1.015, 0b11)), burst(1, 2, (1.01, 0b01))
    outcome = counted(BEGUN, cycle(1.02, ahead, back))
    first, second = outcome.readings
    assert first == EncodersCounted(1.5, 1.6, 1.0, (0, 0), (0.0, 0.0))
    assert (second.stamp_s, second.board_s, second.counts) == (1.52, 1.02, (2, -1))
    assert second.rate_counts_s == pytest.approx((100.0, 0.0))
    assert (outcome.illegal, outcome.repeated, outcome.lost, outcome.warnings) == (0, 0, 0, [])


def test_a_cycle_may_have_several_bursts_of_a_wheel():
    """Two lines of the left wheel's edges: four counts."""
    lines = burst(0, 3, (1.005, 0b10), (1.01, 0b11)), burst(0, 5, (1.012, 0b01), (1.015, 0b00))
    assert counted(BEGUN, cycle(1.02, *lines, RIGHT_STANDS)).readings[-1].counts == (4, 0)


def test_a_cycle_of_standing_wheels_is_a_reading_too():
    """The control loop steps by readings: wheels that stand have theirs."""
    (_, reading) = counted(BEGUN, cycle(1.02, LEFT_STANDS, RIGHT_STANDS)).readings
    assert (reading.counts, reading.rate_counts_s) == ((0, 0), (0.0, 0.0))


def test_a_repetition_is_counted_and_the_reading_stands():
    """The left wheel's levels were as before: nothing moved."""
    outcome = counted(BEGUN, cycle(1.02, burst(0, 2, (1.01, 0b00)), RIGHT_STANDS))
    assert (outcome.repeated, outcome.readings[-1].counts, outcome.warnings) == (1, (0, 0), [])


AHEAD, GONE_AHEAD = burst(0, 3, (1.005, 0b10), (1.015, 0b11)), burst(0, 3)
"""The left wheel two edges further, and standing there."""


def told(outcome: Outcome) -> list[tuple[float, tuple[int, ...]]]:
    """When there was a reading, and its counts."""
    return [(reading.board_s, reading.counts) for reading in outcome.readings]


@pytest.mark.parametrize(
    ("odd", "after", "illegal", "lost"),
    [
        (burst(1, 7, (1.01, 0b10)), burst(1, 8, (1.03, 0b11)), 0, 5),
        (burst(1, 2, (1.01, 0b11)), burst(1, 3, (1.03, 0b01)), 1, 0),
    ],
    ids=["five dropped", "two levels at once"],
)
def test_a_cycle_that_lacks_edges_is_no_reading_and_the_next_is(
    odd: EdgeBurst, after: EdgeBurst, illegal: int, lost: int
):
    """No reading for either wheel, told by the wheel's name; then counting goes on from there."""
    outcome = counted(BEGUN, cycle(1.02, AHEAD, odd), cycle(1.04, GONE_AHEAD, after))
    assert told(outcome) == [(1.0, (0, 0)), (1.04, (2, 1))]
    assert (outcome.illegal, outcome.lost) == (illegal, lost)
    (warning,) = outcome.warnings
    assert (warning["event"], warning["wheels"]) == (
        "encoder edges were lost, so this cycle has no reading",
        ["right"],
    )


def alternating(pattern: str) -> list[bool]:
    """Whether each cycle gave a reading: the right wheel is told (``+``), or its line was lost (``-``)."""
    cycles = [
        cycle(1.02 + 0.02 * number, LEFT_STANDS, *([RIGHT_STANDS] if told_of == "+" else []))
        for number, told_of in enumerate(pattern)
    ]
    stamps = {round(reading.board_s, 3) for reading in counted(BEGUN, *cycles).readings}
    return [round(one.board_s, 3) in stamps for one in cycles]


def test_one_complete_cycle_in_three_is_no_reading_any_more():
    """Of every three cycles two are incomplete: after ten more of those than of complete ones, none is a reading."""
    readings = alternating("--+" * 40)
    assert any(readings[:27])
    assert not any(readings[33:])


def test_complete_cycles_are_readings_again_and_a_third_of_losses_costs_none_of_them():
    """Forty are lost in a row, and count as twenty: the eleventh complete one is a reading."""
    assert alternating("-" * 40 + "+" * 15) == [False] * 50 + [True] * 5
    assert alternating("++-" * 40) == [True, True, False] * 40


def test_a_cycle_in_which_a_wheel_is_not_told_is_no_reading():
    """Its line was lost: it may have stood (the next cycle is whole), or moved (the next lacks two edges)."""
    stood = counted(BEGUN, cycle(1.02, AHEAD), cycle(1.04, GONE_AHEAD, RIGHT_STANDS))
    assert (told(stood), stood.lost) == ([(1.0, (0, 0)), (1.04, (2, 0))], 0)
    moved, on = burst(1, 4, (1.03, 0b11)), burst(1, 5, (1.05, 0b01))
    went = counted(BEGUN, cycle(1.02, AHEAD), cycle(1.04, GONE_AHEAD, moved), cycle(1.06, GONE_AHEAD, on))
    assert (told(went), went.lost) == ([(1.0, (0, 0)), (1.06, (2, 1))], 2)


@pytest.mark.parametrize("at_s", [0.985, 1.03])
def test_edges_timed_outside_their_cycle_are_not_looked_at(at_s: float):
    """Damaged times would be another speed: no reading, and the edge is missed by the next total."""
    damaged, after, on = burst(1, 2, (at_s, 0b10)), burst(1, 3, (1.03, 0b11)), burst(1, 4, (1.05, 0b01))
    outcome = counted(
        BEGUN, cycle(1.02, AHEAD, damaged), cycle(1.04, GONE_AHEAD, after), cycle(1.06, GONE_AHEAD, on)
    )
    assert (told(outcome), outcome.lost) == ([(1.0, (0, 0)), (1.06, (2, 1))], 1)


def test_a_restarted_board_is_referenced_anew():
    """Levels, total and time that the first edge after it brings are no transition from those before, and no loss."""
    outcome = counted(
        cycle(1.0, burst(0, 900, (0.99, 0b00)), RIGHT_STANDS),
        BoardRestarted(1.5, "reset"),
        cycle(0.5, burst(0, 1, (0.49, 0b11)), burst(1, 0)),
    )
    assert (outcome.readings[-1].counts, outcome.illegal, outcome.lost) == ((0, 0), 0, 0)


def test_no_flood_of_cycles_hides_a_restart():
    """A thousand cycles of a board that counts anew, before the service has a turn: no edge is taken for a lost one."""

    async def scenario() -> int:
        bus = Bus()
        service = QuadratureService(bus, QuadratureParameters(), ("left", "right"))
        task = asyncio.create_task(service.run())
        for flood in (
            [BEGUN],
            [BoardRestarted(1.6, "reset"), *[cycle(2.0, burst(0, 0), burst(1, 0))] * 1000],
        ):
            for event in flood:
                bus.publish(event)
            await asyncio.sleep(0)
            await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return service.lost_edges

    assert run_virtual(scenario()) == 0
