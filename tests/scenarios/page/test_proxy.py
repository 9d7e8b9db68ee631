"""The page behind a reverse proxy that ends TLS, on another port and under a folder."""

from pathlib import Path
from typing import Any

import pytest

from chefbotd.transport.ports import reserve_port
from tests.fakes.proxy import tls_proxy
from tests.scenarios.page.browser import NEEDS_BROWSER, RunningRobot, mode_is, sync_api, until

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]


def test_it_works_behind_a_proxy_whose_origin_is_configured(browser: Any, tmp_path: Path) -> None:
    """Every file comes from under the folder, the WebSocket too, and the robot is driven and stopped through it."""
    port = reserve_port()
    robot = RunningRobot(tmp_path, origins=[f"https://127.0.0.1:{port}"])
    page = browser.new_context(ignore_https_errors=True).new_page()
    addresses: list[str] = []
    page.on("request", lambda request: addresses.append(request.url))
    url = f"https://127.0.0.1:{port}/robots/one/"
    try:
        with tls_proxy("robots/one", robot.page_port, port):
            page.goto(url)
            mode_is(page, "Ready to drive")
            page.locator("#estop").click()
            mode_is(page, "Emergency stop")
            page.context.close()
    finally:
        robot.end()
    assert {address.startswith(url) for address in addresses if not address.startswith("data:")} == {True}


def test_a_refused_proxy_is_logged_with_what_to_set(browser: Any, tmp_path: Path) -> None:
    """Without the key the page comes, its WebSocket does not, and the log has the line for the configuration."""
    port = reserve_port()
    robot = RunningRobot(tmp_path)
    page = browser.new_context(ignore_https_errors=True).new_page()
    try:
        with tls_proxy("robot", robot.page_port, port):
            page.goto(f"https://127.0.0.1:{port}/robot/")
            sync_api.expect(page.locator("#connection")).to_have_text("not connected")
            assert until(lambda: "page_origin_refused" in robot.log)
            page.context.close()
    finally:
        robot.end()
    assert f'[page] origins = [\\"https://127.0.0.1:{port}\\"]' in robot.log
