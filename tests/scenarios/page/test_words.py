"""The page speaks to people: no name of a method, a parameter, a key or a client is shown."""

import re
from typing import Any

import pytest

from chefbotd.core.events.robot import RangeStatus
from chefbotd.driving.safety_supervisor import ENCODERS_STALE, NO_BOARD
from chefbotd.link.health import Condition
from chefbotd.link.lidar.health import LidarCondition
from chefbotd.rpc.jsonrpc import ERRORS
from chefbotd.safety.gate import DEAD_MAN, Mode
from chefbotd.safety.scan_guard import OBSTACLE, SILENT
from tests.scenarios.page.browser import NEEDS_BROWSER, FakeDaemon, show, sync_api, until

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]

FOR_PROGRAMS = re.compile(r"\w_\w|undefined|null|NaN|\[object")
SAFE = {"mode": "armed", "reason": "armed", "armed": True, "source": None, "control": {}, "limited_by": None}
GOAL_STATES = (
    *("planning", "driving", "recovering", "paused"),
    *("reached", "unreachable", "blocked", "cancelled", "lost", "fault"),
)


def shown(page: Any) -> str:
    """Every word on the page, also of parts that are hidden at present."""
    words: str = page.locator("body").evaluate("body => [...body.children].map(e => e.textContent).join(' ')")
    return words


def test_every_refusal_is_a_sentence(page: Any, daemon: FakeDaemon) -> None:
    """Whatever kind of refusal an action of the page ends with, the alert has a sentence and none of its names."""
    for kind in ERRORS:
        data: dict[str, Any] = {"kind": str(kind)}
        message = "the lidar is not connected"
        if kind == "invalid_params":
            message = "x_m: Input should be less than or equal to 1000, got 5000"
            expected = "Input should be less than or equal to 1000"
            data["fields"] = [{"field": "waypoints.0.x_m", "expected": expected, "got": "5000"}]
        if kind == "lease_held":
            data |= {"source": "teleop", "holder": "page #a1b2 (10.0.0.7:5)"}
        if kind == "stopped":
            data |= {"source": "teleop", "stopped_by": "Ann (10.0.0.7:5)", "stop_hold_s": 1.0}
        daemon.refusal = {"code": kind.code, "message": message, "data": data}
        page.locator("#alert").evaluate("alert => { alert.textContent = ''; }")
        page.keyboard.press("Space")  # clicks that follow one another at once are one contact
        alert = page.locator("#alert")
        sync_api.expect(alert).to_have_text(re.compile(r"^[A-Z].*\.?$"))
        assert not FOR_PROGRAMS.search(alert.inner_text()), kind
        if kind == "invalid_params":
            sync_api.expect(alert).to_have_text("X: this should be less than or equal to 1000, got 5000.")
        if kind == "lease_held":
            sync_api.expect(alert).to_have_text("Another page drives.")
        if kind == "out_of_range":
            sync_api.expect(alert).to_have_text("The lidar is not connected")


def test_every_state_is_told_in_words(page: Any, daemon: FakeDaemon) -> None:
    """Modes, limits, goals, devices, ranges, and the wheel of a fault."""
    limits = [
        DEAD_MAN,
        ENCODERS_STALE,
        f"{OBSTACLE}front_left",
        f"{SILENT}lidar_top",
        "drive.max_linear_m_s",
    ]
    for mode in (*Mode, NO_BOARD):
        daemon.say("safety", **{**SAFE, "mode": str(mode), "armed": False, "reason": "left_wheel is stuck"})
        sync_api.expect(page.locator("#mode-reason")).to_contain_text("the left wheel is stuck")
        assert not FOR_PROGRAMS.search(shown(page)), mode
    for by in limits:
        daemon.say("safety", **{**SAFE, "limited_by": by})
        sync_api.expect(page.locator("#mode-reason")).to_contain_text("slower than asked: ")
        assert not FOR_PROGRAMS.search(shown(page)), by
    for state in GOAL_STATES:
        daemon.say("navigation", state=state, goal=1, reason=f"{state}: why {state}", distance_m=1.0)
        sync_api.expect(page.locator("#goal")).to_contain_text(f": why {state}")
    for state in ("unknown", "searching", "localized", "uncertain", "lost"):
        daemon.say("localization", state=state, map="flat", fit=0.5, reason=f"so {state}")
        sync_api.expect(page.locator("#map-told")).to_contain_text(f"so {state}")
    for condition in {str(each) for each in (*LidarCondition, *Condition)} - {"healthy"}:
        reason = f"why {condition}".replace("_", " ")
        lidar = {"lidar": "top", "healthy": False, "condition": condition, "reason": reason}
        daemon.say("lidars", lidars=[lidar])
        sync_api.expect(page.locator("#sensors")).to_contain_text(reason)
        assert not FOR_PROGRAMS.search(shown(page)), condition
    for status in RangeStatus:
        measured = {"range_m": 1.0 if status == "ok" else None, "max_range_m": 4.0, "field_of_view_rad": 0.5}
        daemon.say("ranges", ranges=[{"sensor": str(status), "status": str(status), **measured}])
        name = str(status).replace("_", " ")
        sync_api.expect(page.locator("#sensors")).to_contain_text(f"{name}: ")
    assert not FOR_PROGRAMS.search(shown(page))


def test_a_cancelled_goal_says_once_by_whom(page: Any, daemon: FakeDaemon) -> None:
    """By this page, by another page, or by a client with a name of its own: no page's id, no address of ours."""
    assert until(lambda: daemon.was_asked("set_client_name"))
    me = daemon.last("set_client_name")["client"]
    goal = page.locator("#goal")
    for who, words in (
        (f"{me} (127.0.0.1:50312)", "Cancelled: by this page"),
        ("page #zzzz (10.0.0.7:50312)", "Cancelled: by another page"),
        ("Ann's joystick (10.0.0.7:50312)", "Cancelled: by Ann's joystick (10.0.0.7:50312)"),
    ):
        daemon.say("navigation", state="cancelled", goal=1, reason=f"cancelled: by {who}", distance_m=None)
        sync_api.expect(goal).to_have_text(words)


def test_a_sentence_ends_once_and_is_said_once(page: Any, daemon: FakeDaemon) -> None:
    """A pause that begins with its own state, a board without a reason, and a state that is logged twice."""
    daemon.say("link", state="down", device="", reason="closed", healthy=False, condition="down")
    sync_api.expect(page.locator("#link")).to_have_text("not connected")
    paused = "paused, because teleop has control; it goes on by itself"
    daemon.say("navigation", state="paused", goal=1, reason=paused, distance_m=1.0)
    goal = page.locator("#goal")
    sync_api.expect(goal).to_have_text("Paused, 1.0 m left: because teleop has control; it goes on by itself")
    daemon.say("navigation", state="reached", goal=1, reason="reached (1.25, 3.00)", distance_m=0.0)
    sync_api.expect(goal).to_have_text("Arrived: (1.25, 3.00)")
    line = {"level": "info", "source": "mapping", "text": "mapping"}
    again = {**line, "text": "mapping: the floor is level", "stamp_s": 2.0}
    daemon.say("log", lines=[{**line, "stamp_s": 1.0}, again], stamp_s=2.0)
    sync_api.expect(page.locator("#lately").get_by_text("Making a map.")).to_have_count(1)


def test_a_reason_that_says_the_same_is_left_out(page: Any, daemon: FakeDaemon) -> None:
    """The robot waits for its board because it waits for its board. And who drives is called as it calls itself."""
    line = {"level": "info", "source": "safety", "text": "no_board: waiting for the board", "stamp_s": 1.0}
    driven = {"level": "info", "source": "control", "text": "teleop: chefbotctl drive on vm", "stamp_s": 2.0}
    daemon.say("log", lines=[line, driven], stamp_s=2.0)
    sync_api.expect(page.locator("#lately")).to_contain_text("chefbotctl drive on vm drives.")
    sync_api.expect(page.locator("#lately")).to_contain_text("Waiting for the board.")
    sync_api.expect(page.locator("#lately")).not_to_contain_text("board: waiting")


def test_calibration_speaks_of_parameters_and_asks_in_sentences(page: Any, served: str) -> None:
    """No key of the configuration is shown, and the question has its ends; "Do not begin" begins nothing."""
    step = {"name": "motors", "purpose": "the motors", "missing": "", "space_m": 0.3, "on_request": False}
    estimate = {"key": "wheel_pid.left_wheel.ks", "before": 10.0, "after": 12.0, "sigma": 0.5, "unit": ""}
    result = {
        "step": "motors",
        "status": "passed",
        "reason": "well done",
        "estimates": [estimate],
        "plots": [],
    }
    daemon = FakeDaemon(page)
    daemon.capable_of("get_calibration", "calibrate", "apply_calibration")
    daemon.held = {"get_calibration"}
    daemon.opened(served)
    imu = {**step, "name": "imu", "purpose": "the heading", "missing": "there is none"}
    steps = [{**each, "preparation": "put it on blocks, so that they hang free"} for each in (step, imu)]
    daemon.answer("get_calibration", steps=steps, results=[result])
    show(page, "workshop")
    part = page.locator("#calibration-steps")
    sync_api.expect(part).to_contain_text("IMU")
    sync_api.expect(part).to_contain_text("ks (left)")
    sync_api.expect(part).to_contain_text("Passed. Well done.")
    assert not FOR_PROGRAMS.search(part.inner_text())
    page.get_by_role("button", name="Again: motors").click()
    sync_api.expect(page.locator("#confirm-question")).to_have_text(
        "Put it on blocks, so that they hang free. It needs 0.3 m of free floor on every side. "
        "The robot may move; any stop ends it."
    )
    page.get_by_role("button", name="Do not begin").click()
    assert not daemon.was_asked("calibrate")


def test_the_boards_firmware_is_told_in_words(page: Any, daemon: FakeDaemon) -> None:
    """A classic sketch does not stop by itself; ours says its version and its dead-man, or that it has none now."""
    daemon.say("link", state="up", device="/dev/ttyACM0", reason="", healthy=True, condition="healthy")
    sync_api.expect(page.locator("#firmware")).to_have_text("classic, not known to stop by itself")
    ours = {"version": "0.1", "board": "tm4c123", "reset_cause": "power_on", "round_trip_s": 0.012}
    counted = dict.fromkeys(("crc_errors", "refused", "deadman_stops"), 0)
    daemon.say("firmware", **ours, **counted, mode="checked", deadman_ms=250)
    sync_api.expect(page.locator("#firmware")).to_have_text("0.1, stops by itself after 250 ms")
    daemon.say("firmware", **ours, **counted, mode="classic", deadman_ms=None)
    sync_api.expect(page.locator("#firmware")).to_have_text("0.1, does not stop by itself now")
    assert not FOR_PROGRAMS.search(shown(page))
