"""Logs: JSON for machines, colours for people."""

import io
import json
import sys
from collections.abc import Iterator

import pytest
import structlog

from chefbotd import logs


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def _undo() -> Iterator[None]:
    yield
    structlog.reset_defaults()


def test_off_a_terminal_every_line_is_a_json_object(monkeypatch: pytest.MonkeyPatch):
    """Event, level, time and what was bound; an exception is told inside its line."""
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    logs.configure("info")
    log = structlog.get_logger(component="test")
    log.info("hello", number=7, odd={1})
    try:
        raise OSError("gone")
    except OSError:
        log.exception("failed")
    hello, failed = map(json.loads, stream.getvalue().splitlines())
    assert (hello["event"], hello["level"], hello["component"], hello["number"]) == (
        "hello",
        "info",
        "test",
        7,
    )
    assert "timestamp" in hello
    assert "OSError: gone" in failed["exception"]


def test_on_a_terminal_lines_are_coloured(monkeypatch: pytest.MonkeyPatch):
    """People get the console renderer with its escape sequences."""
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    logs.configure("info")
    structlog.get_logger().info("hello")
    assert "\x1b[" in stream.getvalue()
    assert "hello" in stream.getvalue()


def test_below_the_level_nothing_is_written(monkeypatch: pytest.MonkeyPatch):
    """At 'warning' an info line vanishes and a warning stays."""
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    logs.configure("warning")
    log = structlog.get_logger()
    log.info("small")
    log.warning("big")
    assert "small" not in stream.getvalue()
    assert "big" in stream.getvalue()
