"""The page's stop on a phone: at the first touch, by Space and by Esc; and it is said where it did not arrive."""

import functools
import http.server
import json
import os
import re
import shutil
import threading
from collections.abc import Iterator
from http import HTTPStatus
from importlib.util import find_spec
from typing import Any

import pytest
from chefbot_speech.server import files

CHROMIUM = shutil.which("chromium")
READY = {"phase": "ready", "text": "", "proposal": "table 3", "places": ["table 3"], "left_out": []}


class Files(http.server.BaseHTTPRequestHandler):
    """The page's files, without a line of log for each."""

    def do_GET(self) -> None:
        """What the add-on serves at this path."""
        content_type, body = files()[self.path]
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", content_type)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    """Where the page's files are."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Files)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_address[1]}/"
    server.shutdown()
    thread.join()
    server.server_close()


class Talker:
    """The other end of the page's WebSocket."""

    def __init__(self, page: Any) -> None:
        self.heard: list[dict[str, Any]] = []
        self.answers = True
        page.route_web_socket(re.compile("/socket$"), self._connected)

    def _connected(self, socket: Any) -> None:
        self.socket = socket
        socket.on_message(self._take)

    def _take(self, line: str) -> None:
        message = json.loads(line)
        self.heard.append(message)
        if "token" in message:
            self.socket.send(json.dumps(READY))
        elif message["event"] == "stop" and self.answers:
            self.socket.send(json.dumps({**READY, "stopped": True}))

    def count(self, event: str) -> int:
        """How often an event was told."""
        return sum(message.get("event") == event for message in self.heard)


@pytest.fixture
def phone(url: str) -> Iterator[tuple[Any, Talker]]:
    """The page on a phone, and what it talks to."""
    if CHROMIUM is None or find_spec("playwright") is None:
        pytest.fail("no browser") if os.environ.get("ADDONS_TESTS") == "required" else pytest.skip(
            "no browser"
        )
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        context = browser.new_context(viewport={"width": 390, "height": 800}, has_touch=True, is_mobile=True)
        page = context.new_page()
        talker = Talker(page)
        page.goto(url)
        page.locator("#yes").wait_for()
        yield page, talker
        browser.close()


@functools.cache
def protocol_of(page: Any) -> Any:
    """One for all touches of a page: it remembers which fingers are down."""
    return page.context.new_cdp_session(page)


def touch(page: Any, kind: str, *points: tuple[float, float]) -> None:
    """A touch of Chromium's own protocol with these fingers down."""
    fingers = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
    protocol_of(page).send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": fingers})
    page.wait_for_timeout(200)


def middle(page: Any, name: str) -> tuple[float, float]:
    """The middle of an element."""
    box = page.locator(name).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_it_stops_while_another_finger_rests_or_talks(phone: tuple[Any, Talker]) -> None:
    """Once, at the touch: beside a finger on the title, and on the button to talk. *No* is one touch too."""
    page, talker = phone
    for number, rests_on in enumerate(("h1", "#talk")):
        touch(page, "touchStart", middle(page, rests_on))
        touch(page, "touchStart", middle(page, rests_on), middle(page, "#stop"))
        assert talker.count("stop") == number + 1
        touch(page, "touchEnd")
        assert talker.count("stop") == number + 1
    touch(page, "touchStart", middle(page, "#no"))
    assert [message for message in talker.heard if message.get("event") == "answer"] == [
        {"event": "answer", "choice": "no"}
    ]


def test_space_and_esc_stop_from_everywhere(phone: tuple[Any, Talker]) -> None:
    """Space on *Yes* begins no drive; on the button to talk it talks, which brakes."""
    page, talker = phone
    page.locator("#yes").focus()
    page.keyboard.press("Space")
    page.locator("#talk").focus()
    page.keyboard.press("Escape")
    page.wait_for_timeout(200)
    assert (talker.count("stop"), talker.count("answer")) == (2, 0)
    page.keyboard.press("Space")
    page.wait_for_timeout(200)
    assert (talker.count("stop"), talker.count("press")) == (2, 1)


def test_a_stop_that_did_not_arrive_is_told(phone: tuple[Any, Talker]) -> None:
    """Without an answer, and without a connection; it goes when the stop is answered."""
    page, talker = phone
    talker.answers = False
    page.keyboard.press("Escape")
    told = page.locator("#unreached")
    told.wait_for()
    assert "did not reach the robot" in told.inner_text()
    talker.answers = True
    page.keyboard.press("Escape")
    told.wait_for(state="hidden")
    talker.socket.close()
    page.get_by_text("the robot may still be driving").wait_for()
    page.keyboard.press("Escape")
    told.wait_for()
