"""Many random sequences on the virtual clock, in blocks: each has a loop of its own, which so many share."""

import random
from collections.abc import Awaitable, Callable
from typing import TypeVar

from chefbotd.clock import run_virtual

T = TypeVar("T")

BLOCK = 250


def run_sequences(one: Callable[[random.Random], Awaitable[T]], number: int, seed: int) -> list[T]:
    """What came of so many sequences, one after the other, with the choices of one seed."""
    choose = random.Random(seed)

    async def block(size: int) -> list[T]:
        return [await one(choose) for _ in range(size)]

    return [
        ended for begun in range(0, number, BLOCK) for ended in run_virtual(block(min(BLOCK, number - begun)))
    ]
