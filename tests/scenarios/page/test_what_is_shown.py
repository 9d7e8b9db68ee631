"""What the page shows of a robot, how much it loads, and whether everybody can read and use it."""

import re
from typing import Any

import pytest

from tests.scenarios.page.browser import (
    NEEDS_BROWSER,
    FakeDaemon,
    RunningRobot,
    barriers,
    open_page,
    show,
    sync_api,
    until,
)

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]
MOST_BYTES = 300_000


def test_it_loads_light_and_only_from_the_robot(page: Any, robot: RunningRobot) -> None:
    """Less than 300 kB, nothing from elsewhere; what the robot has not is not shown, and every control has a name."""
    answers: list[Any] = []
    page.on("response", lambda answer: answers.append(answer))
    open_page(page, robot)
    assert {answer.url.startswith(robot.url) for answer in answers} == {True}
    assert 5_000 < sum(len(answer.body()) for answer in answers) < MOST_BYTES
    assert page.locator("#robot").inner_text() == "chefbot"
    show(page, "workshop")
    assert page.locator("#wheels-part").is_visible()
    assert not page.locator("#tab-map").is_visible()
    assert not page.locator("#maps-part").is_visible()
    assert not page.locator("#gesture-label").is_visible()
    sync_api.expect(page.locator("#wheels tr")).to_have_count(2)
    sync_api.expect(page.locator("#wheels tr").first.locator("td").nth(3)).to_have_text("200")  # kp
    tree = page.locator("body").aria_snapshot()
    assert not re.search(r"^\s*- (button|slider|combobox|checkbox|textbox)\s*(:|\[|$)", tree, re.MULTILINE), (
        tree
    )


@pytest.mark.parametrize("robot", [{"name": "khan"}], indirect=True)
def test_a_robot_with_four_wheels_and_no_lidar_shows_what_it_has(page: Any, robot: RunningRobot) -> None:
    """KHAN: a row for each wheel, its one range finder, no lidar, map, goal or place; and it drives."""
    open_page(page, robot)
    assert page.locator("#robot").inner_text() == "khan"
    sync_api.expect(page.locator("#wheels th")).to_have_text(
        ["front left", "front right", "rear left", "rear right"]
    )
    sync_api.expect(page.locator("#sensors li")).to_have_count(1)
    sync_api.expect(page.locator("#sensors li")).to_contain_text("front")
    hidden = ("#tab-map", "#tab-goals", "#gesture-label", "#layer-costmap", "#layer-scan", "#layer-map-walls")
    for part in hidden:
        sync_api.expect(page.locator(part)).to_be_hidden()
    with robot.client() as client:
        page.keyboard.down("KeyD")
        assert until(lambda: client.get_state().odometry.angular_rad_s < -0.2)
        page.keyboard.up("KeyD")
        assert until(lambda: abs(client.get_state().odometry.angular_rad_s) < 0.02)


def test_a_gain_is_set_for_a_wheel_and_taken_back(page: Any, robot: RunningRobot) -> None:
    """The daemon has the new gain, the table shows it, and undo brings the packaged 200 back."""
    open_page(page, robot)
    show(page, "workshop")
    shown = page.locator("tr[data-wheel=left_wheel] td").nth(3)
    sync_api.expect(shown).to_have_text("200")
    page.locator("#gain-wheel").select_option("left_wheel")
    page.locator("#gain-value").fill("170.5")
    page.get_by_role("button", name="Set").click()
    sync_api.expect(shown).to_have_text("170.5")
    with robot.client() as client:
        gains = client.get_pid()
    assert (gains["left_wheel"].kp, gains["right_wheel"].kp) == (170.5, 200.0)
    page.get_by_role("button", name="Undo").click()
    sync_api.expect(shown).to_have_text("200")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1200, 390])
def test_it_has_no_barrier_that_axe_can_find(page: Any, daemon: FakeDaemon, scheme: str, width: int) -> None:
    """Names, roles, contrast and order, with every part shown, on a screen and on a phone, by day and by night."""
    page.set_viewport_size({"width": width, "height": 800})
    page.emulate_media(color_scheme=scheme)
    daemon.say("navigation", state="driving", goal=1, reason="", distance_m=3.21, time_s=9.0)
    daemon.say("localization", state="localized", map="flat", fit=0.97, reason="")
    daemon.say("safety", mode="estopped", reason="by Ann", armed=False, source=None, control={})
    show(page, "goals")
    sync_api.expect(page.locator("#place-form")).to_be_visible()
    tabs = page.locator("#rail button:visible")
    for number in range(tabs.count()):
        show(page, tabs.nth(number).get_attribute("id").removeprefix("tab-"))
        assert barriers(page) == []


def test_a_screen_reader_is_told_faults_at_once_and_goals_without_the_metres(
    page: Any, daemon: FakeDaemon
) -> None:
    """A fault interrupts; what is left to drive changes all the time and is not read out, how the goal ends is."""
    ready = {"mode": "armed", "reason": "armed", "armed": True, "source": None, "control": {}}
    daemon.say("safety", **ready)
    told = page.locator("#mode-told")
    sync_api.expect(told).to_have_text("Ready to drive")
    assert told.get_attribute("aria-live") == "polite"
    sync_api.expect(page.locator("#arm")).to_be_disabled()
    stalled = {"mode": "disarmed", "reason": "left_wheel does not turn: check its plug", "armed": False}
    daemon.say("safety", **{**ready, **stalled})
    sync_api.expect(told).to_contain_text("check its plug. When it is safe, press Arm.")
    assert told.get_attribute("aria-live") == "assertive"
    daemon.say("navigation", state="driving", goal=1, reason="", distance_m=3.21, time_s=9.0)
    sync_api.expect(page.locator("#goal-told")).to_have_text("Driving")
    daemon.say("navigation", state="blocked", goal=1, reason="a chair", distance_m=1.0, time_s=9.0)
    sync_api.expect(page.locator("#goal-told")).to_have_text("The way is blocked: a chair")
    assert page.locator("#goal").get_attribute("role") is None


RECORDER = {
    "state": "idle",
    "file": None,
    "seconds": 0.0,
    "bytes_written": 0,
    "ring_s": 300.0,
    "free_bytes": 9e9,
}


def test_what_has_just_happened_is_saved(page: Any, daemon: FakeDaemon) -> None:
    """The recorder's state, and a button that keeps the last minutes, if the robot has them in memory."""
    save = page.get_by_role("button", name="Save what has just happened")
    daemon.say("recording", **RECORDER, reason="")
    show(page, "workshop")
    recorder = page.locator("#recorder")
    sync_api.expect(recorder).to_have_text("Not recording. The last 5 min are kept in memory.")
    daemon.held = {"save_ring"}
    save.click()
    daemon.answer("save_ring", file="asked_1.mcap", seconds=297.0)
    sync_api.expect(page.locator("#recorder-told")).to_have_text("The last 5 min are in asked_1.mcap.")
    going = {"state": "recording", "file": "evening.mcap", "seconds": 61.0, "bytes_written": 2_500_000}
    daemon.say("recording", **{**RECORDER, **going, "ring_s": 0.0}, reason="")
    sync_api.expect(recorder).to_have_text("Recording into evening.mcap: 61 s, 2.5 MB. 9.0 GB are free.")
    sync_api.expect(save).to_be_hidden()
    page.get_by_role("button", name="Stop recording").click()
    assert until(lambda: daemon.was_asked("stop_recording"))


def test_a_history_is_bounded_and_has_a_gap_where_nothing_was_known(page: Any, daemon: FakeDaemon) -> None:
    """10,000 samples, one a second, of which 300 are kept: a line with 299 steps; its name has the range in words."""
    script = """async (count) => { const { History } = await import("/history.js");
      window.plot = new History("battery-history",
        { name: "Battery", unit: "V", digits: 1, span_s: 1, most: 300, least_range: 0.5 });
      for (let s = 0; s < count; s += 1) window.plot.add(12 + (s % 2) / 2, s); }"""
    show(page, "workshop")
    page.evaluate(script, 10_000)
    plot = page.locator("#battery-history")
    expected = "Battery: 12.0 to 12.5 V in the last 5 min"
    sync_api.expect(plot.get_by_role("img", name=expected)).to_be_visible()
    line = plot.locator("path").get_attribute("d")
    assert (line.count("M"), line.count("L")) == (1, 299)
    page.evaluate("window.plot.gap(10000.5); window.plot.add(11.0, 10010)")
    line = plot.locator("path").get_attribute("d")
    assert (line.count("M"), line.count("L")) == (2, 297)


def line(stamp_s: float, source: str, text: str, level: str = "info") -> dict[str, Any]:
    """A line of the daemon's log."""
    return {"level": level, "source": source, "text": text, "stamp_s": stamp_s}


def test_lately_is_the_daemons_log_also_of_before_in_words(page: Any, daemon: FakeDaemon) -> None:
    """A line of an hour ago stands below the page's first one, with its own time; none is said twice."""
    lines = [
        line(100.0, "link", "open: /dev/ttyACM0"),
        line(3700.0, "safety", "estopped: by Ann"),
        line(3700.5, "safety", "armed: started (limited by obstacle:front)"),
    ]
    for _ in range(2):
        daemon.say("log", lines=lines, stamp_s=3700.5, age_s=30.0)
    daemon.say(
        "log", lines=[*lines, line(3702.0, "lidar", "sends nothing", "warning")], stamp_s=3702.0, age_s=0.0
    )
    shown = page.locator("#lately li")
    sync_api.expect(shown).to_have_count(5)
    for number, words in enumerate(
        (
            "Lidar: sends nothing",
            "Connected.",
            "Slower than asked: there is an obstacle (front).",
            "Emergency stop: by Ann",
            "The board's link: open: /dev/ttyACM0",
        )
    ):
        sync_api.expect(shown.nth(number)).to_contain_text(words)
    ages_s = page.evaluate(
        "[...document.querySelectorAll('#lately time')].map((each) => (Date.now() - Date.parse(each.dateTime)) / 1000)"
    )
    assert ages_s[4] - ages_s[2] == pytest.approx(3600.5, abs=0.002)
    assert 3630.5 < ages_s[4] < 3730.0


def test_lately_is_bounded_and_says_what_it_says_itself_once(page: Any, daemon: FakeDaemon) -> None:
    """Of a hundred lines the newest 50 are kept; a recording that goes on is one line however often it is told."""
    for _ in range(3):
        daemon.say("recording", **{**RECORDER, "state": "recording"}, reason="")
    lines = page.locator("#lately li")
    sync_api.expect(page.locator("#lately").get_by_text("Recording.")).to_have_count(1)
    said = [line(float(number), "daemon", f"reason {number}") for number in range(100)]
    daemon.say("log", lines=said[:50], stamp_s=49.0, age_s=50.0)
    daemon.say("log", lines=said[50:], stamp_s=99.0, age_s=0.0)
    sync_api.expect(lines).to_have_count(50)
    sync_api.expect(lines.nth(0)).to_contain_text("reason 99")


def test_a_robot_that_waits_does_not_fill_the_log_and_the_log_can_be_filtered(
    page: Any, daemon: FakeDaemon
) -> None:
    """After a stop and 60 waits on the way there are the stop, two lines of the way, and none of them elsewhere."""
    said = [line(0.0, "safety", "estopped: by Ann"), line(0.5, "lidar", "sends nothing", "warning")]
    for number in range(60):
        said += [
            line(1.0 + number, "navigation", "driving"),
            line(1.5 + number, "navigation", "recovering: a person"),
        ]
    for first in range(0, len(said), 40):
        part = said[first : first + 40]
        daemon.say("log", lines=part, stamp_s=part[-1]["stamp_s"], age_s=0.0)
    lately = page.locator("#lately")
    sync_api.expect(lately).to_contain_text("Driving. (60 times)")
    sync_api.expect(lately).to_contain_text("Looking for a way out: a person (60 times)")
    show(page, "lately")
    sync_api.expect(lately.get_by_text("Emergency stop: by Ann")).to_be_visible()
    shown = page.locator("#lately li:visible")
    for kind, words in (
        ("way", ["Looking", "Driving."]),
        ("stops", ["Emergency"]),
        ("problems", ["Lidar"]),
    ):
        page.locator("#lately-kind").select_option(kind)
        sync_api.expect(shown).to_contain_text(words)


@pytest.mark.parametrize(
    ("width", "height", "beside", "alone"),
    [
        (360, 740, 0.42, 0.69),
        (390, 844, 0.44, 0.73),
        (844, 390, 0.38, 0.66),
        (683, 384, 0.34, 0.64),  # 1366 by 768 at 200 %
        (820, 1180, 0.45, 0.80),
        (1200, 800, 0.55, 0.77),
        (1280, 800, 0.56, 0.78),
        (1920, 1080, 0.65, 0.83),
    ],
)
def test_the_view_has_the_room_that_it_needs(
    page: Any, daemon: FakeDaemon, width: int, height: int, beside: float, alone: float
) -> None:
    """Of the window, the map has at least so much beside an open panel (the workshop may be wider), and without one.

    Nothing covers it there but its own buttons, the joystick is in reach without scrolling, and nothing is cut off.
    """
    page.set_viewport_size({"width": width, "height": height})
    daemon.say("navigation", state="driving", goal=1, reason="", distance_m=3.21, time_s=9.0)
    file = f"/home/robot/.local/state/chefbotd/{'recordings_' * 20}/drive.mcap"
    daemon.say("recording", **{**RECORDER, "state": "recording", "file": file}, reason="")
    sync_api.expect(page.locator("#recorder")).to_contain_text("drive.mcap")
    shares = {}
    for panel in ("goals", "map", "lately", "drive"):
        show(page, panel)
        page.wait_for_timeout(300)  # until a sheet is as high as it gets
        shares[panel] = page.evaluate(FREE) / (width * height)
    bar = page.locator("#stops").bounding_box()
    assert page.locator("#joystick").bounding_box()["y"] + 110 < bar["y"]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.locator("#tab-drive").click()
    sync_api.expect(page.locator("#panels")).to_be_hidden()
    page.wait_for_timeout(300)
    shares["none"] = page.evaluate(FREE) / (width * height)
    assert shares.pop("none") >= alone
    assert min(shares.values()) >= beside, shares


@pytest.mark.parametrize("width", [360, 390, 1280])
def test_where_the_robot_is_stands_in_one_line_whatever_the_figures(
    page: Any, daemon: FakeDaemon, width: int
) -> None:
    """The scale above it does not jump when a figure gets longer; on an upright phone the turning speed is left out."""
    page.set_viewport_size({"width": width, "height": 800})
    pose = page.locator("#pose")
    heights = set()
    for x_m, turn in ((0.0, 0.0), (-12.34, -1.15)):
        odometry = {"x_m": x_m, "y_m": x_m, "heading_rad": -2.9, "linear_m_s": -0.25, "angular_rad_s": turn}
        daemon.say("odometry", **odometry)
        sync_api.expect(pose).to_contain_text(f"x {x_m:.2f} m")
        heights.add(pose.bounding_box()["height"])
    assert len(heights) == 1
    assert heights.pop() < 32
    assert ("-1.15 rad/s" in pose.inner_text()) == (width > 600)


FREE = """() => {
  const room = document.getElementById("room").getBoundingClientRect();
  const [step, mine] = [8, "#view, .tools, .modes, .lower"]; // the map itself, and its own buttons
  let free = 0;
  for (let x = room.left + step / 2; x < room.right; x += step) {
    for (let y = room.top + step / 2; y < room.bottom; y += step) {
      free += Boolean(document.elementFromPoint(x, y)?.closest(mine));
    }
  }
  return free * step * step;
}"""
"""How many square pixels of the window show the map, of which each is probed at its middle, 8 by 8 pixels at a time."""
