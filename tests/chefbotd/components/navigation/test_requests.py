"""What the navigation skill is still to be told, while its worker is busy or hangs."""

import asyncio

import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.navigation.requests import RequestQueue
from chefbotd.components.navigation.skill_requests import (
    GoalAsked,
    KeepGoals,
    NavigateTo,
    NavigationRequest,
    Pause,
    Resume,
)

GOALS = NavigateTo((GoalAsked(7, 1.0, 2.0, None, 0.0),), queue=False)
OTHERS = NavigateTo((GoalAsked(8, 3.0, 2.0, None, 0.0),), queue=False)


async def waiting(*orders: NavigationRequest) -> list[NavigationRequest]:
    """What is sent in the end, of requests that all came while none was sent."""
    found = RequestQueue()
    for order in orders:
        found.put(order)
    return [await found.next() for _ in range(len(found))]


@pytest.mark.parametrize(
    ("orders", "told"),
    [
        ((Pause("by a key"), Resume(), Pause("teleop")), [Pause("teleop")]),
        ((Pause("by a key"), KeepGoals(()), Resume()), [KeepGoals(()), Resume()]),
        ((KeepGoals((7, 8)), KeepGoals((7,))), [KeepGoals((7,))]),
        ((GOALS, Pause("by a key"), KeepGoals(())), [GOALS, Pause("by a key"), KeepGoals(())]),
        ((GOALS, KeepGoals((7,)), Pause("by a key"), OTHERS), [OTHERS]),
    ],
)
def test_an_order_makes_void_what_it_overrules(
    orders: tuple[NavigationRequest, ...], told: list[NavigationRequest]
) -> None:
    """Goals that are told again are all that are left, and a pause is told anew after them."""
    assert run_virtual(waiting(*orders)) == told


def test_however_much_is_ordered_while_the_worker_hangs_three_wait_at_most() -> None:
    """Ten thousand times pause, resume, cancel and goals, as a client could send them: one of a kind is left."""
    orders = RequestQueue()
    for k in range(10_000):
        orders.put((Pause(str(k)), Resume(), KeepGoals((k,)), GOALS)[k % 4])
        assert len(orders) <= 3


def test_whoever_waits_until_all_is_told_waits_for_the_one_that_is_being_told_too() -> None:
    """A goal that overtook a cancel would be ended by it."""

    async def scenario() -> None:
        orders = RequestQueue()
        await asyncio.wait_for(orders.all_sent(), 0.1)
        orders.put(KeepGoals(()))
        assert await orders.next() == KeepGoals(())
        all_sent = asyncio.create_task(orders.all_sent())
        await asyncio.sleep(1.0)
        assert not all_sent.done()
        next_one = asyncio.create_task(orders.next())
        await asyncio.wait_for(all_sent, 0.1)
        orders.put(Pause("by a key"))
        assert await next_one == Pause("by a key")

    run_virtual(scenario())
