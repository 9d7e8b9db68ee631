"""The floor does what it must to be a fair yardstick: it answers every encoder line, and tells its subscribers."""

import json
from typing import Any, cast

import pytest

from benchmarks.floor import Client, Floor
from benchmarks.ratios import Cost, by_turns, median


class Written:
    """A transport that keeps what was written."""

    def __init__(self) -> None:
        self.lines: list[bytes] = []

    def write(self, data: bytes) -> None:
        """Keep it."""
        self.lines.append(data)


def test_an_encoder_line_is_answered_by_one_proportional_step_for_each_wheel() -> None:
    """Targets 1000 and 2000 counts/s, measured 500 and -250: at 0.02 duty a count that is 10 and 45."""
    floor, board = Floor(), Written()
    floor.connection_made(cast(Any, board))
    floor.target_counts_s = (1000.0, 2000.0)
    floor.data_received(b"t\t1000000\t0.02\ne\t50\t-25\nt\t1100000\t0.1\ne\t100\t-5")
    floor.data_received(b"0\n")
    assert board.lines == [b"s 0 0\r", b"s 19 40\r", b"s 10 45\r"]


@pytest.mark.parametrize("topics", [["odometry", "wheels"], ["odometry"], ["wheels"]])
def test_a_subscriber_is_told_its_topics_at_each_encoder_line(topics: list[str]) -> None:
    """A JSON line for each; nothing more after it has gone."""
    floor, board, client = Floor(), Written(), Written()
    floor.connection_made(cast(Any, board))
    caller = Client(floor)
    caller.connection_made(cast(Any, client))
    caller.data_received(
        json.dumps({"id": 1, "method": "subscribe", "params": {"topics": topics}}).encode() + b"\n"
    )
    floor.data_received(b"t\t1000000\t0.02\ne\t14854\t14854\n")
    answer, *told = map(json.loads, client.lines)
    assert answer["id"] == 1
    assert [event["params"]["topic"] for event in told] == topics
    assert {event["params"]["data"].get("x_m") for event in told} == {
        1.0 if t == "odometry" else None for t in topics
    }
    caller.connection_lost(None)
    floor.data_received(b"t\t1100000\t0.1\ne\t14900\t14900\n")
    assert len(client.lines) == 1 + len(topics)


def test_a_ratio_is_taken_from_rounds_measured_by_turns() -> None:
    """The first program's costs are 1, 2, 6 and the second's 10, 40, 20: medians 2 and 20."""
    order = iter([1.0, 10.0, 2.0, 40.0, 6.0, 20.0])

    def cost() -> Cost:
        return Cost(next(order), 0.0, 0.0, 0.0, 0.0, 0.0)

    floor, ours = by_turns(3, cost, cost)
    assert (median(floor, "cores"), median(ours, "cores")) == (2.0, 20.0)
