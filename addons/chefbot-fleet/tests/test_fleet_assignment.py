"""Orders to robots."""

from chefbot_fleet.assignment import Order, assign
from chefbot_fleet.roadmap import Roadmap


def pairs(
    roadmap: Roadmap, robots: dict[str, int], orders: list[Order], now_s: float = 0.0
) -> dict[str, str]:
    """Which robot gets which order."""
    return {name: order.identifier for name, order in assign(roadmap, robots, orders, now_s)}


def test_the_sum_of_the_ways_is_shortest(corridor: Roadmap) -> None:
    """Ann at 1, Bob at 4; orders at 0 and 2: Ann is nearest to both, and takes 0 (1 + 2 m against 1 + 4 m)."""
    orders = [Order("left", 0, 4), Order("middle", 2, 0)]
    assert pairs(corridor, {"ann": 1, "bob": 4}, orders) == {"ann": "left", "bob": "middle"}


def test_an_order_that_has_waited_long_goes_first(corridor: Roadmap) -> None:
    """A robot at 0: an order at 0 of now, and one at 4 that is two minutes old (worth 6 m, and 4 m away)."""
    orders = [Order("near", 0, 2, 120.0), Order("old", 4, 2, 0.0)]
    assert pairs(corridor, {"ann": 0}, orders, 120.0) == {"ann": "old"}
    assert pairs(corridor, {"ann": 0}, [Order("near", 0, 2), Order("far", 4, 2)]) == {"ann": "near"}


def test_an_order_that_nobody_can_reach_waits(corridor: Roadmap) -> None:
    """Its drop lies behind a missing edge."""
    cut = corridor.without_edge(3, 4)
    assert pairs(cut, {"ann": 0}, [Order("beyond", 1, 4)]) == {}


def test_nothing_to_assign(corridor: Roadmap) -> None:
    """No robot, or no order."""
    assert pairs(corridor, {}, [Order("a", 0, 1)]) == {}
    assert pairs(corridor, {"ann": 0}, []) == {}
