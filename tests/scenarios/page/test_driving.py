"""Keys, joystick and gamepad of the page drive the robot; whatever may hide that they are let go brakes it."""

import math
import os
import signal
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from chefbotd.client.errors import CallError
from tests.scenarios.page.browser import (
    NEEDS_BROWSER,
    FakeDaemon,
    RunningRobot,
    comes_to_rest,
    mode_is,
    moves,
    only_a_new_press_drives,
    open_page,
    show,
    stays_at_rest,
    sync_api,
    until,
)

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]


def test_a_key_drives_until_it_is_let_go(page: Any, robot: RunningRobot) -> None:
    """Pressed, it drives and has control; let go, it brakes and gives control back."""
    open_page(page, robot)
    with robot.client() as client:
        page.keyboard.down("KeyS")
        assert moves(client, -1)
        sync_api.expect(page.locator("#drivers")).to_have_text("this page (driving by hand)")
        page.keyboard.up("KeyS")
        assert comes_to_rest(client)
        sync_api.expect(page.locator("#drivers")).to_have_text("nobody")


@pytest.mark.parametrize("event", ["blur", "pagehide"])
def test_a_tab_without_the_focus_drives_nothing(page: Any, robot: RunningRobot, event: str) -> None:
    """The robot brakes though the key is still down; only a new press drives again."""
    open_page(page, robot)
    with robot.client() as client:
        page.keyboard.down("ArrowUp")
        assert moves(client)
        page.evaluate("name => { window.dispatchEvent(new Event(name)) }", event)
        assert comes_to_rest(client)
        assert only_a_new_press_drives(page, client, "ArrowUp")


@pytest.mark.parametrize("event", ["contextmenu", "dragstart", "keydown Control"])
def test_what_may_hide_the_end_of_a_key_ends_the_driving(page: Any, daemon: FakeDaemon, event: str) -> None:
    """With a menu open, in a drag and after a shortcut, a browser may not tell that a key is let go."""
    page.locator("h1").click()

    def pressed() -> bool:
        page.keyboard.up("KeyS")
        page.keyboard.down("KeyS")
        return daemon.was_asked("drive") and daemon.last("drive") == {"linear_m_s": -0.2, "angular_rad_s": 0}

    assert until(pressed)
    before = len(daemon.asked)
    if event.startswith("keydown"):
        page.keyboard.down(event.partition(" ")[2])
    else:
        page.evaluate("name => { document.body.dispatchEvent(new Event(name, { bubbles: true })) }", event)
    ends = [("drive", {"linear_m_s": 0, "angular_rad_s": 0}), ("release_control", {})]

    def last_asked() -> list[tuple[str, dict[str, Any]]]:
        daemon.was_asked("drive")  # playwright hands over what has come
        return [each for each in daemon.asked[before:] if each[0] in ("drive", "release_control")][-2:]

    assert until(lambda: last_asked() == ends)
    page.wait_for_timeout(1000)  # longer than a key that drives takes to ask again
    assert last_asked() == ends


def test_the_emergency_stop_is_a_key_and_a_button(page: Any, robot: RunningRobot) -> None:
    """Esc while driving latches; arm releases; the button latches again, and a key that is still down moves nothing."""
    open_page(page, robot)
    with robot.client() as client:
        page.keyboard.down("KeyW")
        assert moves(client)
        page.keyboard.press("Escape")
        mode_is(page, "Emergency stop")
        assert client.get_state().safety.mode == "estopped"
        assert "press Arm" in page.locator("#mode-reason").inner_text()
        page.locator("#arm").click()
        mode_is(page, "Ready to drive")
        assert stays_at_rest(client)
        page.keyboard.up("KeyW")
        page.locator("#estop").click()
        mode_is(page, "Emergency stop")


def test_taking_over_from_another_driver(page: Any, robot: RunningRobot) -> None:
    """The page says who drives; after taking over its keys drive, and the other is refused."""
    open_page(page, robot)
    refused: list[str] = []
    ends = threading.Event()

    def other() -> None:
        with robot.client() as client:
            client.set_client_name("Ann")
            while not ends.wait(0.05):
                try:
                    client.drive(linear_m_s=0.0, angular_rad_s=0.3)
                except CallError as error:
                    refused.append(error.kind)

    driver = threading.Thread(target=other)
    driver.start()
    try:
        sync_api.expect(page.locator("#drivers")).to_contain_text("Ann")
        page.keyboard.down("KeyW")
        sync_api.expect(page.locator("#drive-told")).to_contain_text("Ann")
        page.keyboard.up("KeyW")
        assert "lease_held" not in refused
        page.locator("#take").click()
        page.keyboard.down("KeyW")
        sync_api.expect(page.locator("#drivers")).to_have_text("this page (driving by hand)")
        assert until(lambda: "lease_held" in refused)
    finally:
        ends.set()
        driver.join()


def test_a_frozen_tab_drives_nothing_when_it_goes_on(browser: Any, page: Any, robot: RunningRobot) -> None:
    """The browser's processes stand still for four seconds with a key down: the robot brakes, and stays where it is.

    The tab does not know what was let go meanwhile. It shows what is now, and a new press drives.
    """
    open_page(page, robot)
    told = browser.new_browser_cdp_session().send("SystemInfo.getProcessInfo")["processInfo"]
    tabs = [each["id"] for each in told if each["type"] == "renderer"]
    with robot.client() as client:
        page.keyboard.down("KeyW")
        assert moves(client)
        for tab in tabs:
            os.kill(tab, signal.SIGSTOP)
        try:
            assert comes_to_rest(client)
            assert client.get_state().safety.mode == "armed"  # by the dead-man: no fault
            time.sleep(3.0)
            stands = client.get_state().odometry
        finally:
            for tab in tabs:
                os.kill(tab, signal.SIGCONT)
        mode_is(page, "Ready to drive")
        time.sleep(1.0)
        now = client.get_state().odometry
        assert math.hypot(now.x_m - stands.x_m, now.y_m - stands.y_m) < 0.005
        sync_api.expect(page.locator("#pose")).to_contain_text(f"x {now.x_m:.2f} m")
        assert only_a_new_press_drives(page, client)


def test_a_phone_drives_by_the_joystick(page: Any, robot: RunningRobot) -> None:
    """At 390 pixels nothing is cut off, the emergency stop is in sight, and the joystick drives until it is let go."""
    page.set_viewport_size({"width": 390, "height": 844})
    open_page(page, robot)
    assert page.evaluate("() => document.documentElement.scrollWidth") == 390
    show(page, "workshop")
    edges = "() => [...document.querySelectorAll('table')].map((each) => each.getBoundingClientRect().right)"
    page.wait_for_function("() => document.querySelectorAll('td').length > 0")
    assert all(edge <= 390 for edge in page.evaluate(edges)), page.evaluate(edges)
    button = page.locator("#estop").bounding_box()
    assert button["y"] + button["height"] <= 844
    show(page, "drive")
    pad = page.locator("#joystick").bounding_box()
    middle = (pad["x"] + pad["width"] / 2, pad["y"] + pad["height"] / 2)
    with robot.client() as client:
        page.mouse.move(*middle)
        page.mouse.down()
        page.mouse.move(middle[0] - 10, middle[1] - 60)
        assert moves(client)
        page.mouse.up()
        assert comes_to_rest(client)


def choose_another_panel(page: Any) -> None:
    """By the keyboard."""
    page.locator("#tab-goals").press("Enter")


def close_the_panel(page: Any) -> None:
    """By its own tab."""
    page.locator("#tab-drive").press("Enter")


def scroll_away(page: Any) -> None:
    """The panel shows the end of what it has."""
    page.evaluate("""() => { document.getElementById("panel-drive").style.paddingBottom = "3000px";
      document.getElementById("panels").scrollTop = 3000; }""")


def make_the_window_low(page: Any) -> None:
    """So low that the joystick has no room in the panel that it had."""
    page.set_viewport_size({"width": 1280, "height": 130})


@pytest.mark.parametrize("hide", [choose_another_panel, close_the_panel, scroll_away, make_the_window_low])
def test_a_joystick_that_is_not_seen_any_more_drives_nothing(
    page: Any, daemon: FakeDaemon, hide: Callable[[Any], None]
) -> None:
    """Held while it goes out of sight, it is let go; seen again with the button still down, it drives nothing."""
    show(page, "drive")
    pad = page.locator("#joystick").bounding_box()
    middle = (pad["x"] + pad["width"] / 2, pad["y"] + pad["height"] / 2)
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0], middle[1] - 40)
    assert daemon.last("drive")["linear_m_s"] > 0
    hide(page)
    ends = [("drive", {"linear_m_s": 0, "angular_rad_s": 0}), ("release_control", {})]

    def last_asked() -> list[tuple[str, dict[str, Any]]]:
        daemon.was_asked("drive")  # playwright hands over what has come
        return [each for each in daemon.asked if each[0] in ("drive", "release_control")][-2:]

    assert until(lambda: last_asked() == ends, within_s=10.0)
    page.mouse.move(middle[0], middle[1] - 20)
    show(page, "drive")
    page.mouse.move(middle[0], middle[1] - 30)
    page.wait_for_timeout(500)  # six times as long as a joystick that drives takes to ask again
    assert last_asked() == ends


GAMEPAD = """() => {
  window.pad = { connected: true, mapping: "standard", axes: [0, 0, 0, 0],
    buttons: Array.from({ length: 17 }, () => ({ pressed: false })) };
  navigator.getGamepads = () => [window.pad];
}"""


def test_a_gamepad_drives_while_its_enable_button_is_held(page: Any, robot: RunningRobot) -> None:
    """The stick alone moves nothing, LB and the stick drive backward, LB let go brakes, B is the emergency stop."""
    open_page(page, robot)
    page.evaluate(GAMEPAD)
    with robot.client() as client:
        page.evaluate("() => { window.pad.axes = [0.05, 0.9, 0, 0] }")
        assert stays_at_rest(client)
        page.evaluate("() => { window.pad.buttons[4].pressed = true }")
        assert moves(client, -1)
        page.evaluate("() => { window.pad.buttons[4].pressed = false }")
        assert comes_to_rest(client)
        page.evaluate("() => { window.pad.buttons[1].pressed = true }")
        mode_is(page, "Emergency stop")
