"""The card of the messages to somebody who is away, in a real browser before the real program."""

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any

import pytest

from tests.scenarios.page.browser import NEEDS_BROWSER, RunningRobot, barriers, open_page, show, sync_api

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]


@pytest.fixture
def address() -> Iterator[str]:
    """A web server on this computer that takes every message."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *args: Any) -> None:
            """Say nothing."""

    server = HTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/3f9c-secret"
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_test_message_is_sent_and_has_arrived(page: Any, tmp_path: Any, address: str, scheme: str) -> None:
    """The card names the server without its secret, and says that the message has arrived; on a phone it fits."""
    robot = RunningRobot(tmp_path, more=f'\n[notifications]\nenabled = true\nwebhook_url = "{address}"\n')
    try:
        page.emulate_media(color_scheme=scheme)
        open_page(page, robot)
        show(page, "people")
        card = page.locator("#notifications-part")
        sync_api.expect(card).to_contain_text("No message yet.")
        sync_api.expect(card).to_contain_text("Told of: a goal that is reached")
        page.get_by_role("button", name="Send a test message").click()
        sync_api.expect(card).to_contain_text("This is a test of its notifications. It has arrived.")
        assert "3f9c-secret" not in card.inner_text()
        assert barriers(page) == []
        page.set_viewport_size({"width": 360, "height": 740})
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    finally:
        robot.end()
