"""Logs: JSON for machines, colours for people."""

import io
import json
import logging
import re
import sys
from collections.abc import Iterator

import pytest
import structlog

from chefbotd.process import logs


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


def test_the_first_lines_on_a_terminal_fit_80_columns(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    """What says where the page is can be clicked: a short time, no padding, and no field that says nothing."""
    monkeypatch.setattr(sys, "stderr", Terminal())
    writer = logs.configure("info")
    structlog.get_logger().info("page_listening", url="http://127.0.0.1:7380/")
    log = structlog.get_logger(component="safety")
    log.info("safety mode changed", fault=None, mode="armed", reason="started")
    writer.close()
    lines = [re.sub(r"\x1b\[[\d;]*m", "", line) for line in capfd.readouterr().err.splitlines()]
    assert [len(line) <= 80 for line in lines] == [True, True]
    assert re.fullmatch(r"\d\d:\d\d:\d\d \[info\] page_listening +url=http://127.0.0.1:7380/", lines[0])


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
