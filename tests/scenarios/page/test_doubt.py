"""The page says that the robot is stopped only where that is known, and that a stop has arrived only where it has."""

from typing import Any

import pytest

from tests.scenarios.page.browser import NEEDS_BROWSER, FakeDaemon, barriers, sync_api, until

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]

PERHAPS = "The robot may still be driving"
HOLD = "Hold it or switch its motors off"
ARMED = {"mode": "armed", "reason": "armed", "armed": True, "source": None, "control": {}, "fault": None}
LOST = {
    **ARMED,
    "mode": "disarmed",
    "armed": False,
    "fault": "link_lost",
    "reason": "the link was lost: was it unplugged?",
}
UP = {"state": "up", "device": "/dev/ttyACM0", "reason": "", "healthy": True, "condition": "healthy"}
DOWN = {**UP, "state": "down", "reason": "was it unplugged?", "healthy": False, "condition": "down"}
OURS = {
    "version": "0.1",
    "board": "tm4c123",
    "reset_cause": "power_on",
    "round_trip_s": 0.012,
    "crc_errors": 0,
    "refused": 0,
    "deadman_stops": 0,
}
DRIVES = {"x_m": 1.0, "y_m": 0.0, "heading_rad": 0.0, "linear_m_s": 0.3, "angular_rad_s": 0.0}


def says(page: Any, word: str, reason: str = "") -> None:
    """Wait for what the card at the top says."""
    sync_api.expect(page.locator("#mode-word")).to_have_text(word)
    sync_api.expect(page.locator("#mode-reason")).to_contain_text(reason)


def test_a_classic_board_that_is_unplugged_may_still_drive(page: Any, daemon: FakeDaemon) -> None:
    """It keeps its last duty: no word of "stopped", no speed, and no sentence with two ends; plugged in, it is known."""
    daemon.say("link", **UP)
    daemon.say("safety", **ARMED)
    daemon.say("odometry", **DRIVES)
    sync_api.expect(page.locator("#pose")).to_contain_text("0.30 m/s")
    daemon.say("safety", **LOST)
    daemon.say("link", **DOWN)
    says(page, PERHAPS, HOLD)
    sync_api.expect(page.locator("#mode-reason")).to_contain_text(
        "The board is not connected: was it unplugged?"
    )
    assert "?." not in page.locator("#mode").inner_text()
    assert "stopped" not in page.locator("#mode").inner_text().lower()
    sync_api.expect(page.locator("#pose")).to_contain_text("speed not known")
    sync_api.expect(page.locator("#link")).to_have_text("not connected: was it unplugged?")
    assert barriers(page) == []
    daemon.say("link", **UP)
    says(page, "Stopped by a fault", "was it unplugged? When it is safe, press Arm.")
    sync_api.expect(page.locator("#pose")).to_contain_text("0.30 m/s")


def test_a_board_that_stops_by_itself_is_trusted_to_have_stopped(page: Any, daemon: FakeDaemon) -> None:
    """Its last word counts from before it was lost, when the daemon took it back; another board is trusted anew."""
    daemon.say("link", stamp_s=10.0, **UP)
    daemon.say("firmware", stamp_s=10.1, **OURS, mode="checked", deadman_ms=250)
    daemon.say("safety", stamp_s=10.2, **ARMED)
    daemon.say("firmware", stamp_s=20.0, **OURS, mode="classic", deadman_ms=None)
    daemon.say("link", stamp_s=20.001, **DOWN)
    daemon.say("safety", stamp_s=20.002, **LOST)
    says(page, "Stopped by a fault", "Its board stops by itself 250 ms after the last command.")
    daemon.say("link", stamp_s=30.0, **UP)
    daemon.say("link", stamp_s=40.0, **DOWN)
    says(page, PERHAPS, HOLD)


def test_a_board_that_was_classic_before_it_was_lost_is_not_trusted(page: Any, daemon: FakeDaemon) -> None:
    """It had a dead-man and restarted without one, seconds before the cable was pulled."""
    daemon.say("link", stamp_s=10.0, **UP)
    daemon.say("firmware", stamp_s=10.1, **OURS, mode="checked", deadman_ms=250)
    daemon.say("safety", stamp_s=10.2, **ARMED)
    daemon.say("firmware", stamp_s=15.0, **OURS, mode="classic", deadman_ms=None)
    daemon.say("link", stamp_s=20.0, **DOWN)
    says(page, PERHAPS, HOLD)


@pytest.mark.parametrize("condition", ["silent", "wrong_baud", "wrong_device", "echo_stuck"])
def test_a_board_that_is_not_heard_or_does_not_obey_may_drive(
    page: Any, daemon: FakeDaemon, condition: str
) -> None:
    """Its port is open, and no more than that is known."""
    daemon.say("safety", **LOST)
    daemon.say("link", **{**UP, "healthy": False, "condition": condition, "reason": f"why {condition}"})
    says(page, PERHAPS, f"Why {condition}.")


def test_a_board_that_does_not_follow_its_commands_may_drive(page: Any, daemon: FakeDaemon) -> None:
    """The daemon's fault for it, whatever dead-man the board has."""
    daemon.say("link", **UP)
    daemon.say("firmware", **OURS, mode="checked", deadman_ms=250)
    reason = "the board does not follow its commands: switch the motors off"
    daemon.say("safety", **{**LOST, "fault": "board_unresponsive", "reason": reason})
    says(page, PERHAPS, "The board does not follow its commands")


def test_a_lost_connection_leaves_nothing_known(page: Any, daemon: FakeDaemon) -> None:
    """Neither mode, board, battery nor driver are shown as if they were of now; back, they are what they are."""
    daemon.say("link", **UP)
    daemon.say("safety", **{**ARMED, "control": {"teleop": "Ann"}})
    sync_api.expect(page.locator("#drivers")).to_contain_text("Ann")
    daemon.disconnect()
    says(page, PERHAPS, "Not connected, trying again.")
    for fact in ("#link", "#drivers", "#battery", "#latency", "#clients"):
        sync_api.expect(page.locator(fact)).to_have_text("\N{EN DASH}")
    sync_api.expect(page.locator("#connection")).to_have_text("connected")
    daemon.say("safety", **ARMED)
    says(page, "Ready to drive")


def test_an_emergency_stop_without_an_answer_says_so_in_the_largest_type(
    page: Any, daemon: FakeDaemon
) -> None:
    """On a phone nothing is written larger; it goes when the answer comes, and covers no stop."""
    page.set_viewport_size({"width": 390, "height": 844})
    daemon.say("safety", **ARMED)
    daemon.held = {"estop"}
    page.locator("#estop").click()
    alert = page.locator("#unreached")
    sync_api.expect(alert).to_contain_text("The emergency stop did not reach the robot")
    sync_api.expect(alert).to_contain_text(f"{PERHAPS}. {HOLD}.")
    sizes = page.evaluate(
        """() => [...document.body.querySelectorAll("*")].filter((part) => part.id !== "unreached-words")
        .map((part) => parseFloat(getComputedStyle(part).fontSize))"""
    )
    size = page.locator("#unreached-words").evaluate("part => parseFloat(getComputedStyle(part).fontSize)")
    assert size > 1.5 * max(sizes)
    assert (
        alert.bounding_box()["y"] + alert.bounding_box()["height"]
        <= page.locator("#stops").bounding_box()["y"]
    )
    assert barriers(page) == []
    daemon.answer("estop", drivers={})
    sync_api.expect(alert).to_be_hidden()


def test_an_emergency_stop_without_a_connection_is_sent_when_there_is_one(
    page: Any, daemon: FakeDaemon
) -> None:
    """It says at once that it did not reach the robot, and that it is sent again; then it is, once."""
    daemon.say("safety", **ARMED)
    daemon.held = {"estop"}
    page.locator("#estop").click()
    assert until(lambda: daemon.was_asked("estop"))
    daemon.asked.clear()
    daemon.held = set()
    daemon.disconnect()
    sync_api.expect(page.locator("#unreached")).to_contain_text(
        "It is sent again when the connection is back."
    )
    assert until(lambda: daemon.was_asked("estop"))
    sync_api.expect(page.locator("#unreached")).to_be_hidden()
    assert [name for name, _ in daemon.asked].count("estop") == 1


def test_an_emergency_stop_that_the_board_does_not_get_is_none(page: Any, daemon: FakeDaemon) -> None:
    """The daemon answers, and its board is unplugged: the page says that it did not reach the robot."""
    daemon.say("link", **UP)
    daemon.say("safety", **LOST)
    daemon.say("link", **DOWN)
    says(page, PERHAPS)
    page.keyboard.press("Escape")
    sync_api.expect(page.locator("#unreached")).to_contain_text("The board does not get it.")
    daemon.say("link", **UP)
    sync_api.expect(page.locator("#unreached")).to_be_hidden()


def test_a_refused_stop_says_why(page: Any, daemon: FakeDaemon) -> None:
    """In the largest type and in the alert."""
    daemon.say("safety", **ARMED)
    daemon.refusal = {"code": -32000, "message": "no", "data": {"kind": "rate_limited"}}
    page.keyboard.press("Escape")
    sync_api.expect(page.locator("#unreached")).to_contain_text("Too many commands at once")
    page.get_by_role("button", name="I have seen it").click()
    sync_api.expect(page.locator("#unreached")).to_be_hidden()


PAD = """([mapping]) => { navigator.getGamepads = () => [{ connected: true, mapping, axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false })) }]; }"""


def test_a_gamepad_is_promised_only_where_it_can_be_read(page: Any, daemon: FakeDaemon) -> None:
    """None, one of an unknown layout, no API (a page without https), one that is forbidden: no word of B."""
    told = page.locator("#gamepad")
    sync_api.expect(told).to_have_text("A gamepad drives too: press one of its buttons.")
    page.evaluate(PAD, [""])
    sync_api.expect(told).to_contain_text("neither drives nor stops the robot")
    page.evaluate("() => { navigator.getGamepads = undefined; }")
    sync_api.expect(told).to_contain_text("the browser gives none to this page")
    page.evaluate(
        "() => { navigator.getGamepads = () => { throw new DOMException('no', 'SecurityError'); }; }"
    )
    assert "emergency" not in told.inner_text()
    page.locator("h1").click()
    page.keyboard.press("Space")
    assert until(lambda: daemon.was_asked("stop"))
    page.evaluate(PAD, ["standard"])
    sync_api.expect(told).to_contain_text("X stops, B is the emergency stop")
