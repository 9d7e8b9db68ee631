"""A browser, and what its page is opened before."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.scenarios.page.browser import CHROMIUM, PATIENCE_MS, FakeDaemon, RunningRobot, page_alone, sync_api


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Debian's chromium without a window."""
    with sync_api.sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])


@pytest.fixture
def robot(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[RunningRobot]:
    """A robot without tokens, or one with the options that a test gives as its parameter."""
    running = RunningRobot(tmp_path, **getattr(request, "param", {}))
    yield running
    running.end()


@pytest.fixture(scope="module")
def served() -> Iterator[str]:
    """The address of a page with every card, which is opened before a ``FakeDaemon``: one for all tests of a file."""
    with page_alone() as url:
        yield url


@pytest.fixture
def daemon(page: Any, served: str) -> FakeDaemon:
    """A daemon of the tests; the page is open on it."""
    daemon = FakeDaemon(page)
    daemon.opened(served)
    return daemon


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    """A tab; at the end its console must be without an error."""
    context = browser.new_context(viewport={"width": 1200, "height": 800})
    tab = context.new_page()
    tab.set_default_timeout(PATIENCE_MS)
    problems: list[str] = []
    tab.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
    tab.on("pageerror", lambda error: problems.append(str(error)))
    yield tab
    context.close()
    lost_connection = re.compile(r"WebSocket connection to 'ws://127\.0\.0\.1:\d+/socket' failed")
    assert [problem for problem in problems if not lost_connection.search(problem)] == []
