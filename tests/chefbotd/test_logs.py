"""Logs: a count for what repeats itself."""

import asyncio
from collections.abc import Awaitable, Callable

import structlog
from structlog.typing import EventDict

from chefbotd.clock import run_virtual
from chefbotd.logs import RateLimitedLog


def limited(story: Callable[[RateLimitedLog], Awaitable[None]]) -> list[EventDict]:
    """What a limited log has written after a story on the virtual clock."""

    async def run() -> None:
        await story(RateLimitedLog(structlog.get_logger(), every_s=10.0))

    with structlog.testing.capture_logs() as written:
        run_virtual(run())
    return written


def test_a_flood_is_told_once_and_then_counted():
    """A thousand in a second are two lines: the first as it came, and after 10 s the other 999 as a count."""

    async def story(log: RateLimitedLog) -> None:
        for number in range(1000):
            log.warning("line refused", line=number)
            await asyncio.sleep(0.001)
        await asyncio.sleep(60.0)

    assert limited(story) == [
        {"event": "line refused", "line": 0, "log_level": "warning"},
        {"event": "line refused", "line": 999, "more": 999, "within_s": 10.0, "log_level": "warning"},
    ]


def test_what_goes_on_is_summarised_every_period():
    """One a second for 35 s: the first, then ten in each of three periods; nothing is left uncounted but the last."""

    async def story(log: RateLimitedLog) -> None:
        for _ in range(35):
            log.warning("jump")
            await asyncio.sleep(1.0)

    assert [line.get("more") for line in limited(story)] == [None, 9, 10, 10]


def test_each_event_has_a_count_of_its_own():
    """Two kinds of event do not silence each other, and one that has paused is a first one again."""

    async def story(log: RateLimitedLog) -> None:
        log.warning("jump")
        log.warning("line refused")
        await asyncio.sleep(11.0)
        log.warning("jump")

    assert [line["event"] for line in limited(story)] == ["jump", "line refused", "jump"]
