"""Logs: JSON for machines, colours for people, and a count for what repeats itself."""

import asyncio
import io
import json
import logging
import sys
from collections.abc import Awaitable, Callable, Iterator

import pytest
import structlog
from structlog.typing import EventDict

from chefbotd import logs
from chefbotd.clock import run_virtual


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def _undo() -> Iterator[None]:
    before = logging.root.handlers, logging.root.level
    yield
    structlog.reset_defaults()
    logging.root.handlers, logging.root.level = before


def test_off_a_terminal_every_line_is_a_json_object(capfd: pytest.CaptureFixture[str]):
    """Event, level, time and what was bound; an exception is told inside its line."""
    writer = logs.configure("info")
    log = structlog.get_logger(component="test")
    log.info("hello", number=7, odd={1})
    try:
        raise OSError("gone")
    except OSError:
        log.exception("failed")
    writer.close()
    hello, failed = map(json.loads, capfd.readouterr().err.splitlines())
    assert (hello["event"], hello["level"], hello["component"], hello["number"]) == (
        "hello",
        "info",
        "test",
        7,
    )
    assert "timestamp" in hello
    assert "OSError: gone" in failed["exception"]


def test_on_a_terminal_lines_are_coloured(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]):
    """People get the console renderer with its escape sequences."""
    monkeypatch.setattr(sys, "stderr", Terminal())
    writer = logs.configure("info")
    structlog.get_logger().info("hello")
    writer.close()
    told = capfd.readouterr().err
    assert "\x1b[" in told
    assert "hello" in told


def test_below_the_level_nothing_is_written(capfd: pytest.CaptureFixture[str]):
    """At 'warning' an info line vanishes and a warning stays."""
    writer = logs.configure("warning")
    log = structlog.get_logger()
    log.info("small")
    log.warning("big")
    writer.close()
    told = capfd.readouterr().err
    assert "small" not in told
    assert "big" in told


def test_the_standard_library_speaks_through_the_same_log(capfd: pytest.CaptureFixture[str]):
    """What asyncio complains about is a JSON line like any other, with its origin as the component."""
    writer = logs.configure("info")
    logging.getLogger("asyncio").error("a task was %s", "destroyed")
    writer.close()
    told = json.loads(capfd.readouterr().err)
    assert (told["event"], told["component"], told["level"]) == ("a task was destroyed", "asyncio", "error")


def limited(story: Callable[[logs.RateLimitedLog], Awaitable[None]]) -> list[EventDict]:
    """What a limited log has written after a story on the virtual clock."""

    async def run() -> None:
        await story(logs.RateLimitedLog(structlog.get_logger(), every_s=10.0))

    with structlog.testing.capture_logs() as written:
        run_virtual(run())
    return written


def test_a_flood_is_told_once_and_then_counted():
    """A thousand in a second are two lines: the first as it came, and after 10 s the other 999 as a count."""

    async def story(log: logs.RateLimitedLog) -> None:
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

    async def story(log: logs.RateLimitedLog) -> None:
        for _ in range(35):
            log.warning("jump")
            await asyncio.sleep(1.0)

    assert [line.get("more") for line in limited(story)] == [None, 9, 10, 10]


def test_each_event_has_a_count_of_its_own():
    """Two kinds of event do not silence each other, and one that has paused is a first one again."""

    async def story(log: logs.RateLimitedLog) -> None:
        log.warning("jump")
        log.warning("line refused")
        await asyncio.sleep(11.0)
        log.warning("jump")

    assert [line["event"] for line in limited(story)] == ["jump", "line refused", "jump"]


def test_on_a_terminal_a_list_of_lines_is_shortened(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    """Of 400 lines the newest 12 are below the message, a row each, and the rest is a number; a file gets them all."""
    lines = [f"{number:.3f} < e\\t0" for number in range(400)]
    monkeypatch.setattr(sys, "stderr", Terminal())
    writer = logs.configure("info")
    structlog.get_logger().warning("lines around a fault", lines=lines)
    writer.close()
    first, more, *newest = capfd.readouterr().err.splitlines()
    assert "lines around a fault" in first
    assert more.strip() == "(388 earlier lines: only where the log is a file)"
    assert [line.strip() for line in newest] == lines[-12:]
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    structlog.reset_defaults()
    writer = logs.configure("info")
    structlog.get_logger().warning("lines around a fault", lines=lines)
    writer.close()
    assert json.loads(capfd.readouterr().err)["lines"] == lines
