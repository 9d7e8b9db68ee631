"""Stops act at the first contact, by finger, pen, mouse and key, whatever else is going on on the screen."""

from collections.abc import Iterator
from typing import Any

import pytest

from tests.scenarios.page.browser import NEEDS_BROWSER, FakeDaemon, show, sync_api, until

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]

ARMED = {"mode": "armed", "reason": "armed", "armed": True, "source": None, "control": {}}
STOPPED = {"mode": "estopped", "reason": "by Ann", "armed": False, "source": None, "control": {}}
PLACE = {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0}


class Fingers:
    """Touches of a phone by Chromium's own protocol; each finger has a number."""

    def __init__(self, page: Any) -> None:
        self._page, self._protocol = page, page.context.new_cdp_session(page)
        self._down: dict[int, tuple[float, float]] = {}

    def _send(self, kind: str, fingers: dict[int, tuple[float, float]]) -> None:
        points = [{"x": x, "y": y, "id": number} for number, (x, y) in fingers.items()]
        self._protocol.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        self._page.wait_for_timeout(30)

    def down(self, number: int, where: "str | tuple[float, float]") -> None:
        """Put a finger on the middle of an element, or on a place."""
        self._down[number] = self.middle(where) if isinstance(where, str) else where
        self._send("touchStart", self._down)

    def move(self, number: int, right: float, down: float) -> None:
        """Slide a finger in five steps."""
        for _ in range(5):
            x, y = self._down[number]
            self._down[number] = (x + right / 5, y + down / 5)
            self._send("touchMove", self._down)

    def up(self, number: int) -> None:
        """Take a finger away; the others stay."""
        self._send("touchEnd", {number: self._down.pop(number)})

    def tap(self, where: "str | tuple[float, float]") -> None:
        """Down and up."""
        self.down(9, where)
        self.up(9)

    def middle(self, name: str) -> tuple[float, float]:
        """The middle of an element."""
        box = self._page.locator(name).first.bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


@pytest.fixture
def phone(browser: Any, served: str) -> Iterator[Any]:
    """A tab of a phone with a touch screen; its console must be without an error."""
    context = browser.new_context(viewport={"width": 390, "height": 800}, has_touch=True, is_mobile=True)
    tab = context.new_page()
    problems: list[str] = []
    tab.on("pageerror", lambda error: problems.append(str(error)))
    yield tab
    context.close()
    assert problems == []


@pytest.fixture
def robot(phone: Any, served: str) -> FakeDaemon:
    """A daemon of the tests with a robot that is armed; the phone's page is open on it."""
    daemon = FakeDaemon(phone)
    daemon.opened(served)
    daemon.say("safety", **ARMED)
    sync_api.expect(phone.locator("#mode-word")).to_have_text("Ready to drive")
    return daemon


def count(daemon: FakeDaemon, method: str) -> int:
    """How often a method was asked for until now."""
    daemon.was_asked(method)
    return sum(name == method for name, _ in daemon.asked)


@pytest.mark.parametrize("name", ["estop", "stop"])
@pytest.mark.parametrize(
    "rests_on", [None, "#joystick", "#room", "header", "#linear", "#estop", "#lately", "#grip", "#tab-goals"]
)
def test_a_touch_stops_whatever_another_finger_rests_on(
    phone: Any, robot: FakeDaemon, name: str, rests_on: str | None
) -> None:
    """Once at the touch, before it is released, and not again by what follows the release."""
    fingers = Fingers(phone)
    if rests_on is not None:
        show(phone, "lately" if rests_on == "#lately" else "drive")
        phone.locator(rests_on).first.scroll_into_view_if_needed()
        fingers.down(1, rests_on)
        phone.wait_for_timeout(200)
    before = count(robot, name)
    fingers.down(2, f"#{name}")
    assert until(lambda: count(robot, name) == before + 1)
    fingers.up(2)
    phone.wait_for_timeout(400)
    assert count(robot, name) == before + 1


def test_a_touch_stops_while_another_finger_scrolls(phone: Any, robot: FakeDaemon) -> None:
    """The browser has cancelled all pointers of the scroll, and tells of the second finger only as a touch."""
    show(phone, "workshop")
    fingers = Fingers(phone)
    fingers.down(1, "#board-title")
    fingers.move(1, 0.0, -120.0)
    fingers.down(2, "#estop")
    assert until(lambda: count(robot, "estop") == 1)


@pytest.mark.parametrize("distance", [25.0, 150.0])
def test_a_finger_that_slides_has_stopped_it_already(phone: Any, robot: FakeDaemon, distance: float) -> None:
    """Also where it leaves the button; and the page does not scroll under it."""
    fingers = Fingers(phone)
    fingers.down(1, "#estop")
    fingers.move(1, 0.0, -distance)
    fingers.up(1)
    assert until(lambda: count(robot, "estop") == 1)
    assert phone.evaluate("scrollY") == 0


def test_two_fingers_and_a_long_press_stop(phone: Any, robot: FakeDaemon) -> None:
    """Two on the button, and one that rests on it for longer than a menu takes to open."""
    fingers = Fingers(phone)
    x, y = fingers.middle("#estop")
    fingers.down(1, (x - 20, y))
    fingers.down(2, (x + 20, y))
    assert until(lambda: count(robot, "estop") >= 1)
    phone.wait_for_timeout(900)
    fingers.up(1)
    fingers.up(2)
    robot.asked.clear()
    fingers.tap("#estop")
    assert until(lambda: count(robot, "estop") == 1)


def test_a_zoomed_page_keeps_its_stops_in_sight(phone: Any, robot: FakeDaemon) -> None:
    """At 2.5 times the bar is at the bottom of what is seen, not of the page, and works."""
    protocol = phone.context.new_cdp_session(phone)
    protocol.send("Emulation.setPageScaleFactor", {"pageScaleFactor": 2.5})
    phone.wait_for_timeout(300)
    assert phone.evaluate("visualViewport.scale") > 2
    seen = phone.evaluate(
        """() => { const box = document.getElementById("estop").getBoundingClientRect(), seen = visualViewport;
        return [box.left - seen.offsetLeft, seen.offsetLeft + seen.width - box.right,
          box.top - seen.offsetTop, seen.offsetTop + seen.height - box.bottom].map(Math.round); }"""
    )
    assert min(seen) >= 0, seen
    x, y = phone.evaluate(
        """() => { const box = document.getElementById("estop").getBoundingClientRect(), seen = visualViewport;
        return [box.x + box.width / 2 - seen.offsetLeft, box.y + box.height / 2 - seen.offsetTop]; }"""
    )
    Fingers(phone).tap((x, y))
    assert until(lambda: count(robot, "estop") == 1)


def test_arm_is_a_whole_click(phone: Any, robot: FakeDaemon) -> None:
    """A finger that goes down on it arms nothing; nor does Space, which stops."""
    robot.say("safety", **STOPPED)
    sync_api.expect(phone.locator("#arm")).to_be_enabled()
    fingers = Fingers(phone)
    fingers.down(1, "#arm")
    phone.wait_for_timeout(300)
    assert count(robot, "arm") == 0
    fingers.move(1, 0.0, -60.0)
    fingers.up(1)
    phone.locator("#arm").focus()
    phone.keyboard.press("Space")
    assert until(lambda: count(robot, "stop") == 1)
    assert count(robot, "arm") == 0
    fingers.tap("#arm")
    assert until(lambda: count(robot, "arm") == 1)


def test_a_mouse_and_a_pen_stop_when_they_go_down(page: Any, daemon: FakeDaemon) -> None:
    """By each button of the mouse, once; also while another button is held; and a click without a pointer stops too."""
    daemon.say("safety", **ARMED)
    for button in ("left", "right", "middle"):
        before = count(daemon, "estop")
        page.locator("#estop").hover()
        page.mouse.down(button=button)
        assert until(lambda before=before: count(daemon, "estop") == before + 1)  # type: ignore[misc]
        page.mouse.up(button=button)
        page.wait_for_timeout(200)
        assert count(daemon, "estop") == before + 1
    page.locator("h1").hover()
    page.mouse.down(button="right")
    before = count(daemon, "estop")
    page.locator("#estop").hover()
    page.mouse.down(button="left")
    assert until(lambda: count(daemon, "estop") == before + 1)
    page.mouse.up(button="left")
    page.mouse.up(button="right")
    protocol = page.context.new_cdp_session(page)
    x, y = Fingers(page).middle("#stop")
    pen = {"x": x, "y": y, "button": "left", "pointerType": "pen"}
    protocol.send("Input.dispatchMouseEvent", {"type": "mousePressed", "clickCount": 1, **pen})
    assert until(lambda: count(daemon, "stop") == 1)
    protocol.send("Input.dispatchMouseEvent", {"type": "mouseReleased", "clickCount": 1, **pen})
    page.locator("#stop").focus()
    page.keyboard.press("Enter")
    assert until(lambda: count(daemon, "stop") == 2)
    page.locator("#stop").evaluate("button => button.click()")  # as a screen reader does
    assert until(lambda: count(daemon, "stop") == 3)


TAKE_THE_FOCUS = """() => [...document.querySelectorAll("button, select, input, canvas, ol, pre, summary")]
  .filter((part) => part.checkVisibility() && !part.disabled && part.tabIndex >= 0 && part.id)
  .map((part) => part.id)"""


def test_space_stops_from_everywhere_but_a_text_field(page: Any, daemon: FakeDaemon) -> None:
    """With the focus on each part that takes it, Space stops and presses nothing; in a text it types, and Esc stops."""
    daemon.say("safety", **STOPPED)
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    daemon.say("navigation", state="driving", goal=1, reason="", distance_m=3.21, time_s=9.0)
    show(page, "goals")
    sync_api.expect(page.locator("#goal-cancel")).to_be_visible()
    changes = ("arm", "cancel_navigation", "pause_navigation", "localize", "navigate_to", "start_mapping")
    ticked = page.locator("#follow").is_checked()
    seen: set[str] = set()
    for panel in ("goals", "map", "lately", "workshop", "drive"):
        show(page, panel)
        names = set(page.evaluate(TAKE_THE_FOCUS)) - seen - {"place", "map-name"}
        for name in names:
            before = count(daemon, "stop")
            page.locator(f"#{name}").focus()
            page.keyboard.press("Space")
            assert until(lambda before=before: count(daemon, "stop") == before + 1), name  # type: ignore[misc]
        assert page.locator(f"#tab-{panel}").get_attribute("aria-expanded") == "true"
        seen |= names
    assert {"arm", "stop", "follow", "gesture", "linear", "goal-cancel", "view", "lately", "zoom-in"} <= seen
    assert [name for name in changes if count(daemon, name)] == []
    assert page.locator("#follow").is_checked() == ticked
    show(page, "goals")
    page.locator("#place").focus()
    before = count(daemon, "stop")
    page.keyboard.type("table 3")
    assert page.locator("#place").input_value() == "table 3"
    page.keyboard.press("Escape")
    assert until(lambda: daemon.was_asked("estop"))
    assert count(daemon, "stop") == before


def test_space_in_a_question_stops_and_answers_nothing(page: Any, daemon: FakeDaemon) -> None:
    """The question stays; its buttons are pressed by Enter."""
    daemon.say("localization", state="unknown", map=None, fit=0.0, reason="")
    daemon.say("mapping", state="idle", name=None, loops=0, path_m=0.0, unfinished=True, reason="")
    page.locator("#guide-discard").click()
    for name in ("#confirm-no", "#confirm-yes"):
        page.locator(name).focus()
        page.keyboard.press("Space")
    assert until(lambda: count(daemon, "stop") == 2)
    sync_api.expect(page.locator("#confirm")).to_be_visible()
    assert not daemon.was_asked("discard_mapping")


def test_a_swipe_on_a_phone_moves_the_map_and_a_goal_needs_a_second_touch(
    phone: Any, robot: FakeDaemon
) -> None:
    """No swipe, no tap and no double tap sends the robot off; *Go here* does, to where the tap was."""
    robot.say("map_pose", **PLACE, state="localized")
    sync_api.expect(phone.locator("#goal")).to_contain_text("Tap in the view, then Go here")
    fingers = Fingers(phone)
    middle_x, middle_y = fingers.middle("#room")
    fingers.down(1, (middle_x, middle_y + 60))
    fingers.move(1, 0.0, -120.0)
    fingers.up(1)
    phone.wait_for_timeout(200)
    assert not robot.was_asked("navigate_to")
    sync_api.expect(phone.locator("#proposal")).to_be_hidden()
    sync_api.expect(phone.locator("#follow")).not_to_be_checked()  # the view was moved: 120 pixels are 1.33 m
    for _ in range(2):
        fingers.tap((middle_x + 45, middle_y - 30))
    phone.wait_for_timeout(500)
    assert not robot.was_asked("navigate_to")
    sync_api.expect(phone.locator("#proposal")).to_contain_text("drag the dot for a heading")
    fingers.down(1, (middle_x + 45, middle_y - 30))
    fingers.move(1, 0.0, -60.0)
    fingers.up(1)
    sync_api.expect(phone.locator("#proposal")).to_contain_text("heading 90°")
    for _ in range(3):  # on a busy computer a finger may rest too long for a tap: then a person taps again
        fingers.tap("#proposal-go")
        if until(lambda: robot.was_asked("navigate_to"), 2.0):
            break
    assert robot.was_asked("navigate_to")
    assert robot.last("navigate_to") == {
        "x_m": pytest.approx(0.5, abs=0.02),
        "y_m": pytest.approx((30 - 120) / 90, abs=0.13),  # the first ten pixels of a swipe may still be a tap
        "heading_rad": pytest.approx(1.5708, abs=0.05),
    }
    sync_api.expect(phone.locator("#proposal")).to_be_hidden()


def test_a_stop_takes_back_what_is_aimed_at(page: Any, daemon: FakeDaemon) -> None:
    """Space while the mouse aims at a goal: the release sends no robot there."""
    daemon.say("map_pose", **PLACE, state="localized")
    box = page.locator("#room").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 250, box["y"] + 200)
    page.keyboard.press("Space")
    assert until(lambda: count(daemon, "stop") == 1)
    page.mouse.up()
    page.wait_for_timeout(200)
    assert not daemon.was_asked("navigate_to")
