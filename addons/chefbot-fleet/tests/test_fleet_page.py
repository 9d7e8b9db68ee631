"""The manager's page on a phone: an order is cancelled at the first touch, and it is said where that did not arrive."""

import functools
import http.server
import json
import os
import shutil
import threading
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from chefbot_fleet.web import FILES

CHROMIUM = shutil.which("chromium")
ROADMAP = {"points": [[0, 0], [3, 0]], "edges": [[0, 1]], "names": {"counter": 0, "table": 1}, "walls": None}
ORDER = {
    "id": "a1",
    "stage": "assigned",
    "pick": "counter",
    "drop": "table",
    "robot": "one",
    "age_s": 3,
    "why": None,
}
FLEET: dict[str, Any] = {"robots": [], "orders": [ORDER], "strangers": [], "ignored": {}, "managers": {}}


class Files(http.server.SimpleHTTPRequestHandler):
    """The page's files, without a line of log for each."""

    def translate_path(self, path: str) -> str:
        """Where the manager serves it from."""
        return str(FILES.get(path, Path("there is none")))

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


@pytest.fixture
def asked() -> list[str]:
    """The bodies of what the manager was asked to cancel."""
    return []


@pytest.fixture
def phone(url: str, asked: list[str]) -> Iterator[Any]:
    """The page on a phone; the manager is a part of the test."""
    is_here = CHROMIUM is not None and find_spec("playwright") is not None
    if not is_here:
        pytest.fail("no browser") if os.environ.get("ADDONS_TESTS") == "required" else pytest.skip(
            "no browser"
        )
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        context = browser.new_context(viewport={"width": 390, "height": 800}, has_touch=True, is_mobile=True)
        page = context.new_page()

        def cancel(route: Any) -> None:
            asked.append(route.request.post_data)
            route.fulfill(json={})

        page.route("**/api/roadmap", lambda route: route.fulfill(json=ROADMAP))
        page.route("**/api/fleet", lambda route: route.fulfill(json=FLEET))
        page.route("**/api/orders/cancel", cancel)
        page.goto(url)
        page.locator(".cancel").wait_for()
        yield page
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
    page.locator(name).scroll_into_view_if_needed()
    box = page.locator(name).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_an_order_is_cancelled_while_another_finger_rests(phone: Any, asked: list[str]) -> None:
    """Once, at the touch; and once by Enter on the button."""
    cancel = middle(phone, ".cancel")
    title = (40.0, cancel[1] - 60)
    touch(phone, "touchStart", title)
    touch(phone, "touchStart", title, cancel)
    assert [json.loads(body) for body in asked] == [{"id": "a1"}]
    touch(phone, "touchEnd")
    assert len(asked) == 1
    phone.locator(".cancel").focus()
    phone.keyboard.press("Enter")
    phone.wait_for_timeout(200)
    assert len(asked) == 2


def test_a_cancellation_that_did_not_arrive_is_told(phone: Any) -> None:
    """The manager is gone: the robot may drive on, in larger type than anything else on the page."""
    phone.unroute("**/api/orders/cancel")
    phone.route("**/api/orders/cancel", lambda route: route.abort())
    touch(phone, "touchStart", middle(phone, ".cancel"))
    told = phone.locator("#unreached")
    told.wait_for()
    assert "its robot may drive on" in told.inner_text()
    size = "part => parseFloat(getComputedStyle(part).fontSize)"
    assert told.evaluate(size) > 1.25 * phone.locator("h1").evaluate(size)
