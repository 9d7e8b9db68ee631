"""The simulated encoders' edges, and the lines that carry them."""

import math
from itertools import pairwise

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from chefbotd.components.simulation.chassis import PUBLISHED, Chassis
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.peripherals import CycleEdges, Edge, EdgeRecorder
from chefbotd.components.simulation.sensors import InfraredMount
from chefbotd.components.simulation.simulation import Simulation, build_launchpad
from chefbotd.core.events import EdgeBurst
from chefbotd.motion import quadrature
from chefbotd.motion.edge_speed import QuadratureParameters
from firmware_protocol.codec import KHAN_EDGES, from_board
from firmware_protocol.decoder import Decoder
from firmware_protocol.messages import BoardTime, EncoderCounts, QuadratureEdges, QuadratureStill
from tests.budget import examples


def recorder() -> EdgeRecorder:
    """One wheel with eight edges a turn."""
    return EdgeRecorder([8 / math.tau], buffer_edges=100)


def test_a_turn_forward_has_its_edges_in_time_and_order() -> None:
    """3.5 edges of 8 in 7 ms from half an edge: at 1, 3, 5 and 7 ms, A before B."""
    watched = recorder()
    watched.watch(1.0, 1.007, (0.5 / 8 * math.tau,), (4 / 8 * math.tau,))
    (wheel,) = watched.take_edges(2.0)
    total, edges = wheel.total, wheel.edges
    assert (total, [edge.levels for edge in edges]) == (4, [0b10, 0b11, 0b01, 0b00])
    assert [edge.at_s for edge in edges] == pytest.approx([1.001, 1.003, 1.005, 1.007])


def test_the_way_back_has_the_levels_of_the_way_there() -> None:
    """From 1.5 edges back to -0.5: over 1 to level 00, over 0 to 01."""
    watched = recorder()
    watched.watch(0.0, 0.002, (1.5 / 8 * math.tau,), (-0.5 / 8 * math.tau,))
    (wheel,) = watched.take_edges(1.0)
    total, edges = wheel.total, wheel.edges
    assert (total, [edge.levels for edge in edges]) == (2, [0b00, 0b01])
    assert [edge.at_s for edge in edges] == pytest.approx([0.0005, 0.0015])


def test_edges_are_taken_once_and_only_up_to_a_time() -> None:
    """What is later stays; a wheel that stands has none."""
    watched = EdgeRecorder([8 / math.tau] * 2, buffer_edges=100)
    watched.watch(0.0, 0.004, (0.0, 1.0), (math.tau * 2 / 8, 1.0))
    assert watched.take_edges(0.003) == [CycleEdges(1, [Edge(pytest.approx(0.002), 0b10)]), CycleEdges(0, [])]
    assert watched.take_edges(0.003) == [CycleEdges(1, []), CycleEdges(0, [])]
    assert [(wheel.total, len(wheel.edges)) for wheel in watched.take_edges(0.004)] == [(2, 1), (0, 0)]


def test_edges_that_find_no_room_are_dropped_and_counted() -> None:
    """Five edges and room for three: three told, total 3, and the next is the sixth. After a boot it is the first."""
    watched = EdgeRecorder([8 / math.tau], buffer_edges=3)
    watched.watch(0.0, 0.005, (0.0,), (5 / 8 * math.tau,))
    watched.watch(1.0, 1.001, (5 / 8 * math.tau,), (6 / 8 * math.tau,))
    (full,), (after,) = watched.take_edges(0.5), watched.take_edges(2.0)
    assert (full.total, [edge.levels for edge in full.edges]) == (3, [0b10, 0b11, 0b01])
    assert (after.total, [edge.levels for edge in after.edges]) == (6, [0b11])
    watched.boot(2.0)
    watched.watch(2.0, 2.001, (6 / 8 * math.tau,), (7 / 8 * math.tau,))
    assert [wheel.total for wheel in watched.take_edges(3.0)] == [1]


@settings(max_examples=examples(50))
@example([5e-324, -1.611856103644697, -1e-09, 1e-300, -0.001, 1.5, -1e-17])
@given(st.lists(st.floats(-3, 3), min_size=1, max_size=20))
def test_decoded_again_they_are_the_way_that_the_wheel_went(turns: list[float]) -> None:
    """However it goes to and fro, the counts are the whole edges between where it began and where it is."""
    watched, angle = EdgeRecorder([16 / math.tau], buffer_edges=1000), 0.001
    for step, turn in enumerate(turns):
        watched.watch(step, step + 1, (angle,), (angle + turn,))
        angle += turn
    (wheel,) = watched.take_edges(len(turns))
    total, edges = wheel.total, wheel.edges
    parameters = QuadratureParameters()
    state = quadrature.decode(parameters, quadrature.START, EdgeBurst(0, 0, (0,), (-1.0,)))
    if edges:
        times_s, levels = tuple(edge.at_s for edge in edges), tuple(edge.levels for edge in edges)
        state = quadrature.decode(parameters, state, EdgeBurst(0, total, levels, times_s))
    assert (state.counts, state.illegal) == (math.floor(angle * (16 / math.tau)), 0)


def test_an_encoder_that_is_wired_backwards_counts_backwards() -> None:
    """Half a turn forward of such a wheel is four edges with B before A: what a turn backward is of another."""
    watched = EdgeRecorder([-8 / math.tau], buffer_edges=100)
    watched.watch(0.0, 1.0, (math.tau / 16,), (9 / 16 * math.tau,))
    (wheel,) = watched.take_edges(1.0)
    edges = wheel.edges
    assert [edge.levels for edge in edges] == [0b11, 0b10, 0b00, 0b01]


def heard(to_s: float, counts_per_turn: float = 800, **board: float) -> list[object]:
    """What a board of KHAN's says that passes its encoders' edges on, and is told to drive after 1 s."""
    launchpad = build_launchpad(
        Simulation(
            SimulationParameters.model_validate({"board": {"sketch": "khan", **board}}),
            KHAN_EDGES,
            Chassis(PUBLISHED.wheels * 2, PUBLISHED.track_width_m, counts_per_turn),
            ultrasonic=None,
            infrared=(InfraredMount(channel=2),),
            has_imu=False,
        )
    )
    launchpad.receive(b"s 300 300 300 -300\r", 1.0)
    decoder = Decoder(from_board(KHAN_EDGES))
    lines = b"".join(line for _, line in launchpad.advance(to_s))
    messages = [message for _, message in decoder.feed(lines)]
    assert not decoder.malformed
    return messages


def test_the_time_of_a_cycle_is_that_of_its_edges_however_long_they_take_to_print() -> None:
    """With room for 16 bytes the board waits at each line; 20 ms lie between times all the same, standing or turning."""
    messages = heard(2.0, transmit_buffer_bytes=16, line_rate_bytes_s=11520.0)
    times_us = [message.micros for message in messages if isinstance(message, BoardTime)]
    assert [after - before for before, after in pairwise(times_us[1:])] == pytest.approx(
        [20_000] * (len(times_us) - 2), abs=2
    )


def test_a_cycle_is_its_edges_and_then_its_time() -> None:
    """Every edge lies between the ``t`` before its line and the ``t`` after it; counts are not sent."""
    messages = heard(3.0)
    assert not any(isinstance(message, EncoderCounts) for message in messages)
    micros, edges = [], 0
    for message in messages:
        if isinstance(message, BoardTime):
            assert all(before <= each <= message.micros for before, each in pairwise(sorted(micros)))
            assert all(each <= message.micros for each in micros)
            micros = [message.micros]
        elif isinstance(message, QuadratureEdges):
            assert message.micros - sum(message.gaps_us) >= micros[0]
            micros.append(message.micros)
            edges += len(message.states)
    assert edges > 100


def bursts_of_the_left(messages: list[object]) -> list[QuadratureEdges]:
    """Those of wheel 0."""
    return [message for message in messages if isinstance(message, QuadratureEdges) and message.wheel == 0]


def test_a_line_has_the_times_of_its_last_edges() -> None:
    """As many as there are up to four; gaps lead back from the last, and lines follow each other in time and total."""
    left = bursts_of_the_left(heard(4.0))
    assert {len(burst.gaps_us) for burst in left if len(burst.states) >= 4} == {3}
    assert all(len(burst.gaps_us) == min(len(burst.states), 4) - 1 for burst in left)
    for before, after in pairwise(left):
        assert before.micros <= after.micros - sum(after.gaps_us)
        assert after.total == before.total + len(after.states)


def test_a_long_cycle_fills_its_lines() -> None:
    """With a cycle of 0.4 s a burst needs more than one line of 384 edges, whose totals go on from one to the next."""
    left = bursts_of_the_left(heard(4.0, 8000, cycle_s=0.4, edge_buffer=10_000))
    assert max(len(burst.states) for burst in left) == 384
    assert all(after.total == before.total + len(after.states) for before, after in pairwise(left))


def test_a_board_without_room_tells_by_its_total_what_is_missing() -> None:
    """Room for 20 edges, more than 20 a cycle: no cycle has more, and the decoder finds every one that is missing."""
    left = bursts_of_the_left(heard(4.0, 8000, edge_buffer=20))
    assert max(len(burst.states) for burst in left) == 20
    state, told = quadrature.START, 0
    for burst in left:
        event = EdgeBurst(0, burst.total, burst.states, (float(burst.total),))
        state = quadrature.decode(QuadratureParameters(), state, event)
        told += len(burst.states)
    assert state.lost > 100
    assert state.lost + told == left[-1].total
    assert state.illegal == 0


def test_a_board_says_nothing_of_what_is_not_wired_to_it() -> None:
    """Without ultrasonic and IMU a cycle is edges, t, s, a, b."""
    names = {type(message).__name__ for message in heard(2.0)}
    edges = {"QuadratureEdges", "QuadratureStill"}
    assert names == {"Banner", *edges, "BoardTime", "DutyEcho", "AnalogueLevel", "BatteryLevel"}


def test_every_cycle_has_a_line_of_every_wheel() -> None:
    """Standing or turning: between two ``t`` lines each wheel is told, a standing one with the total that it had."""
    wheels, totals, cycles = [], {}, 0
    for message in heard(2.0):
        if isinstance(message, QuadratureStill):
            assert message.total == totals.get(message.wheel, 0)
        if isinstance(message, QuadratureEdges | QuadratureStill):
            wheels.append(message.wheel)
            totals[message.wheel] = message.total
        if isinstance(message, BoardTime):
            assert wheels == [0, 1, 2, 3]
            wheels, cycles = [], cycles + 1
    assert cycles > 50
