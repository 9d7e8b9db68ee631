"""The page in other languages: nothing is left out, nothing is cut on a phone, and Arabic runs from the right."""

import json
import re
from typing import Any, ClassVar

import pytest

from chefbotd.components.navigation.events import NavigationData
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.robot import SafetyChanged
from chefbotd.core.sentence import Sentence, join_sentences
from chefbotd.driving.models import SafetyState, safety_data
from chefbotd.rpc.encoding import encode, plain
from chefbotd.safety.wheels import WheelWatchParameters, WheelWatchState, note_jump
from tests.scenarios.page.browser import NEEDS_BROWSER, FakeDaemon, mode_is, sync_api
from tests.sentences import as_template, patterns

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]

PHONE = {"width": 360, "height": 740}
ACCENTS = str.maketrans("aeiouAEIOUcnsy", "àéïöüÀÉÏÖÜçñšý")
NAMES = {
    *("fake", "kitchen", "table 3", "flat", "Ann", "ntfy", "example.org", "top", "front"),  # of this robot
    *("m", "s", "m/s", "rad/s", "V", "ms", "kp", "ki", "kd", "QR"),  # of units and gains
    *("English", "Deutsch", "Español", "العربية"),
}
"""What is the same in each language; the names of topics to plot are the daemon's, too."""

LEFT_OUT = r"""(names) => {
  const left = [];
  let depth = 0;
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const holder = node.parentElement.closest("select") ?? node.parentElement;
    const isShown = holder.checkVisibility({ visibilityProperty: true });
    const isSeen = isShown && !holder.closest("script, noscript, time, kbd, #language, #plot-topic, #plot-number");
    let outside = "";
    for (const sign of node.data) {
      if (sign === "[") depth += 1;
      else if (sign === "]") depth -= 1;
      else if (depth === 0) outside += sign;
    }
    for (const name of names) outside = outside.replace(new RegExp(`(?<![\\p{L}])${name}(?![\\p{L}])`, "gu"), "");
    if (isSeen && /\p{L}/u.test(outside)) left.push(outside.trim());
  }
  for (const node of document.querySelectorAll("[aria-label], [title], [placeholder]")) {
    for (const name of ["aria-label", "title", "placeholder"]) {
      const words = node.getAttribute(name) ?? "";
      const isOurs = node.checkVisibility() && !node.closest("#lately time, #firmware") && node.id !== "place";
      if (isOurs && /\p{L}/u.test(words) && !words.includes("[")) left.push(`${name}: ${words}`);
    }
  }
  return left;
}"""
CUT = """() => {
  const cut = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const holder = node.parentElement;
    const isSeen = holder.checkVisibility({ visibilityProperty: true }) && node.data.trim();
    if (!isSeen || holder.closest("svg, script, .unseen, select, datalist, #robot")) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    let [left, right] = [0, innerWidth];
    for (let box = holder; box; box = box.parentElement) {
      const { overflowX } = getComputedStyle(box);
      if (["auto", "scroll"].includes(overflowX) && box !== document.body) { // it can be scrolled to
        if (left === 0 && right === innerWidth) [left, right] = [-Infinity, Infinity];
        break;
      }
      if (overflowX === "visible") continue;
      const edges = box.getBoundingClientRect();
      [left, right] = [Math.max(left, edges.left), Math.min(right, edges.right)];
    }
    const isCut = [...range.getClientRects()].some((line) => line.left < left - 1 || line.right > right + 1);
    if (isCut) cut.push(`${holder.id || holder.className || holder.tagName}: ${node.data.trim().slice(0, 60)}`);
  }
  return cut;
}"""
"""Texts of which a part lies outside of the window, or of a part of the page that hides what does not fit.

The robot's own name may be as long as it likes, and ends with dots.
"""


class Furnished(FakeDaemon):
    """A daemon with something in every panel, that says no sentence of its own."""

    METHODS = (
        *FakeDaemon.METHODS,
        *("list_zones", "save_zone", "delete_zone", "undo_zones", "make_invitation", "list_invitations"),
        *(
            "send_test_notification",
            "get_calibration",
            "calibrate",
            "get_pid",
            "set_pid",
            "list_goals",
            "load_map",
        ),
    )
    TOPICS = (*FakeDaemon.TOPICS, "wheels", "notifications", "zones", "calibration", "stats")
    RESULTS: ClassVar[dict[str, Any]] = {
        **FakeDaemon.RESULTS,
        "list_zones": {
            "zones": [
                {
                    "id": 1,
                    "kind": kind,
                    "name": "",
                    "enabled": True,
                    "points_m": [[0, 0], [1, 0], [1, 1]],
                    **more,
                }
                for kind, more in (
                    ("keep_out", {}),
                    ("slow", {"max_speed_m_s": 0.1}),
                    ("wall", {"width_m": 0.1}),
                )
            ],
            "revision": 1,
            "can_undo": True,
        },
        "list_invitations": {
            "invitations": [{"invitation": 1, "device": "", "role": "guest"}],
            "devices": [{"device": 2, "name": "Ann", "role": "drive", "expires_s": None}],
        },
        "get_calibration": {
            "steps": [
                {"name": name, "purpose": "[]", "missing": "", "preparation": "[]", "space_m": 0.3}
                for name in ("imu", "umbmark")
            ],
            "results": [],
        },
        "get_pid": {"wheels": {"left_wheel": {"kp": 1.0, "ki": 2.0, "kd": 0.0}}},
        "list_goals": {"goals": [{"goal": 1, "x_m": 1.5, "y_m": -0.25, "heading_rad": None}]},
        "list_maps": {"in_use": None, "maps": [{"name": "flat", "in_use": False}]},
    }

    def live(self) -> None:
        """Say one event of each part, without a reason in it."""
        self.say(
            "safety",
            mode="armed",
            reason="",
            armed=True,
            source=None,
            control={},
            limited_by="obstacle:front",
        )
        self.say("odometry", x_m=0.0, y_m=0.0, heading_rad=0.0, linear_m_s=0.1, angular_rad_s=0.0)
        self.say("battery", voltage_v=12.1, percentage=20.0, status="low")
        self.say("link", state="up", device="", reason="", healthy=True, condition="healthy")
        self.say("localization", state="localized", map="flat", fit=0.5, reason="")
        self.say("navigation", state="driving", goal=1, reason="", distance_m=1.0)
        self.say(
            "recording",
            state="idle",
            file=None,
            seconds=0,
            bytes_written=0,
            ring_s=30,
            free_bytes=9e9,
            reason="",
            saved="",
        )
        self.say("lidars", lidars=[{"lidar": "top", "healthy": False, "condition": "silent", "reason": ""}])
        wheels = {
            "name": ["left_wheel"],
            "velocity_rad_s": [1.0],
            "target_rad_s": [1.0],
            "duty": [100],
            "excluded": [],
        }
        self.say("wheels", **wheels)
        server = {"name": "ntfy", "host": "example.org", "state": "silent", "waiting": 0}
        self.say("notifications", kinds=["stuck", "fault"], servers=[server])
        self.say("agents", agents=[{"name": "Ann", "text": "[]"}], buttons=[], questions=[])
        line = {"level": "info", "source": "control", "text": "", "stamp_s": 1.0}
        self.say(
            "log",
            lines=[line, {**line, "source": "navigation", "text": "driving", "stamp_s": 2.0}],
            stamp_s=2.0,
        )


class WithCamera(Furnished):
    """With a camera, too."""

    METHODS = (*Furnished.METHODS, "get_camera_frame")
    error: ClassVar[dict[str, Any]] = {}

    def _take(self, socket: Any, line: str) -> None:
        request = json.loads(line)
        if request["method"] == "get_camera_frame":
            self._answer(request.get("id"), {"error": self.error}, socket)
        else:
            super()._take(socket, line)


def pseudo(words: Any) -> Any:
    """A sentence that is longer and in brackets, its placeholders and keys as they were."""
    if isinstance(words, dict):
        return {form: pseudo(sentence) for form, sentence in words.items()}
    parts = re.split(r"(\{\w+\})", words)
    accented = "".join(part if part.startswith("{") else part.translate(ACCENTS) for part in parts)
    return f"[{accented}{'·' * int(0.4 * sum(map(len, parts[::2])))}]"


def opened(page: Any, served: str, language: str, kind: type[Furnished] = Furnished) -> Furnished:
    """The page in a language that the browser has not kept yet, with something in every panel."""
    page.add_init_script(f"localStorage.setItem('chefbotd-page-language', '\"{language}\"')")
    daemon = kind(page)
    daemon.opened(served)
    sync_api.expect(page.locator("html")).to_have_attribute("lang", language)
    daemon.live()
    return daemon


def with_pseudo_language(page: Any) -> None:
    """Serve a language that is made of the English words."""
    # Read before the page waits for its words, which it does for three seconds.
    refusals = {f"refusal.{key}": as_template(pattern) for key, pattern in patterns()}
    languages = 'LANGUAGES.qps = { name: "[]", direction: "ltr", version: "1" };'

    def add(route: Any) -> None:
        route.fulfill(body=f"{route.fetch().text()}\n{languages}", content_type="text/javascript")

    def translate(route: Any) -> None:
        english = json.loads(route.fetch(url=route.request.url.replace("qps", "en")).text())
        english |= refusals
        route.fulfill(json={key: pseudo(words) for key, words in english.items()})

    page.route("**/english.js", add)
    page.route("**/languages/qps.json", translate)


def untranslated(page: Any, where: str) -> str:
    """What of the text of an element is plain English: without accents in the pseudo-language, but for the names."""
    text: str = page.locator(where).inner_text()
    for name in sorted(NAMES, key=len, reverse=True):
        text = re.sub(rf"(?<!\w){re.escape(name)}(?!\w)", "", text)
    return " ".join(word for word in re.findall(r"[^\s\[\]()·⁨⁩]+", text) if re.search("[aeiou]", word))


def test_wheels_are_named_in_the_language_also_where_its_words_come_late(page: Any, served: str) -> None:
    """The daemon has long been heard when the words are there: the choice of a wheel has them all the same."""
    with_pseudo_language(page)
    late: list[Any] = []
    page.route("**/languages/qps.json", lambda route: late.append(route))
    page.add_init_script("localStorage.setItem('chefbotd-page-language', '\"qps\"')")
    daemon = Furnished(page)
    page.goto(served)
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    page.wait_for_timeout(500)  # an answer to whatever the page has asked is there
    late[0].fulfill(json={"wheel.left": "[links]"})
    sync_api.expect(page.locator("#gain-wheel option[value=left_wheel]")).to_have_text("[links]")
    assert daemon.was_asked("get_pid")


def panels(page: Any) -> list[str]:
    """The panels that have a tab, opened one after the other while this is iterated."""
    return [tab.get_attribute("id") for tab in page.locator("#rail > button:visible").all()]


def test_no_sentence_is_left_out(page: Any, served: str) -> None:
    """In a language that is English with brackets around each sentence, all but names is in brackets."""
    with_pseudo_language(page)
    opened(page, served, "qps")
    sync_api.expect(page.locator("#mode-reason")).to_contain_text("[")
    left: list[str] = page.evaluate(LEFT_OUT, sorted(NAMES))
    for tab in panels(page):
        page.locator(f"#{tab}").click()
        left += [f"{tab}: {each}" for each in page.evaluate(LEFT_OUT, sorted(NAMES))]
    assert sorted(set(left)) == []


@pytest.mark.parametrize("language", ["qps", "de", "ar"])
def test_nothing_is_cut_on_a_phone(page: Any, served: str, language: str) -> None:
    """On a phone 360 pixels wide, in each panel, and the stops are in sight with all their words."""
    page.set_viewport_size(PHONE)
    with_pseudo_language(page)
    opened(page, served, language)
    cut: list[str] = page.evaluate(CUT)
    for tab in panels(page):
        page.locator(f"#{tab}").click()
        cut += [f"{tab}: {each}" for each in page.evaluate(CUT)]
    assert sorted(set(cut)) == [], "\n".join(sorted(set(cut)))
    for button in ("estop", "stop", "arm"):
        sync_api.expect(page.locator(f"#{button}")).to_be_in_viewport(ratio=1)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    direction = "rtl" if language == "ar" else "ltr"
    sync_api.expect(page.locator("html")).to_have_attribute("dir", direction)


def test_a_language_is_chosen_and_kept(page: Any, daemon: FakeDaemon) -> None:
    """After the choice the page begins anew in it, from its first moment; the stop says so too."""
    page.locator("#language").select_option("de")
    sync_api.expect(page.locator("#estop")).to_have_text("NOT-HALT Esc")
    daemon.say("safety", mode="armed", reason="", armed=True, source=None, control={}, limited_by=None)
    mode_is(page, "Fahrbereit")
    page.route("**/languages/de.json", lambda route: route.abort())
    page.reload()
    sync_api.expect(page.locator("#estop")).to_have_text("NOT-HALT Esc")
    sync_api.expect(page.locator("#language")).to_have_value("de")


def test_the_browsers_first_language_counts_whatever_its_region(page: Any, served: str) -> None:
    """Austria's German is German, though Spanish without a region comes after it."""
    page.add_init_script("Object.defineProperty(navigator, 'languages', { value: ['de-AT', 'es', 'en'] })")
    FakeDaemon(page).opened(served)
    sync_api.expect(page.locator("html")).to_have_attribute("lang", "de")
    sync_api.expect(page.locator("#estop")).to_have_text("NOT-HALT Esc")


def test_a_refusal_is_said_by_its_id(page: Any, daemon: FakeDaemon) -> None:
    """In the reader's language, its arguments too, of which one is a sentence; else in the daemon's English."""
    page.locator("#language").select_option("de")
    sync_api.expect(page.locator("#estop")).to_have_text("NOT-HALT Esc")
    why = {"id": "driving.no_board", "arguments": {}, "message": "the board is not connected"}
    data = {"kind": "pose_unknown", "id": "maps.pose_unknown", "arguments": {"map": "flat", "why": why}}
    daemon.refusal = {"code": -32046, "message": "where it is is not known", "data": data}
    alert = page.locator("#alert")
    page.keyboard.press("Space")
    said = (
        "Wo der Roboter auf der Karte „flat“ ist, ist nicht bekannt (die Steuerplatine ist nicht verbunden)"
    )
    sync_api.expect(alert).to_contain_text(said)
    daemon.refusal["data"]["id"] = "trip.far"
    page.keyboard.press("Space")
    sync_api.expect(alert).to_have_text("Where it is is not known")


def test_a_stop_waits_for_no_language(page: Any, served: str) -> None:
    """Where the words do not come, the stops are English, and the emergency stop is sent at once."""
    page.add_init_script("localStorage.setItem('chefbotd-page-language', '\"de\"')")
    page.route("**/languages/de.json", lambda route: None)  # never answered
    daemon = FakeDaemon(page)
    page.goto(served)
    sync_api.expect(page.locator("#robot")).to_have_text("fake")
    sync_api.expect(page.locator("#estop")).to_have_text("EMERGENCY STOP Esc")
    page.locator("#estop").click()
    assert daemon.was_asked("estop")


def stopped(reason: str, fault: str | None = None, mode: str = "disarmed") -> dict[str, Any]:
    """The data of the topic ``safety`` of a robot that is stopped for this reason."""
    data: dict[str, Any] = plain(safety_data(SafetyState(SafetyChanged(1.0, mode, reason, None, fault))))
    return data


def jumping_wheels() -> str:
    """The reason for the fault of two wheels whose encoders jump."""
    names = ("left_wheel", "right_wheel")
    _, fault = note_jump(WheelWatchParameters(jumps=1), names, WheelWatchState((), (0.0, 0.0)), (0, 1))
    assert fault is not None
    return fault.reason


def test_why_the_robot_is_stopped_is_said_in_the_readers_language(page: Any, served: str) -> None:
    """With all that the reason names; a client's own words stay as they are."""
    with_pseudo_language(page)
    daemon = opened(page, served, "qps")
    reason = page.locator("#mode-reason")
    daemon.say("safety", **stopped(jumping_wheels(), "encoder_jumps"))
    sync_api.expect(reason).to_contain_text("[thé [léft·] whéél····] àñd")
    assert untranslated(page, "#mode-reason") == ""
    asked = Sentence("driving.asked", "asked by a client")
    daemon.say("safety", **stopped(asked, mode="estopped"))
    sync_api.expect(reason).to_contain_text("[àškéd bý à çlïéñt")
    daemon.say("safety", **stopped("fire in the kitchen", mode="estopped"))
    sync_api.expect(reason).to_contain_text("fire in the kitchen")


def said(kind: RefusalKind, words: str) -> dict[str, Any]:
    """The error of a refusal with these words."""
    refused = Refused(kind, words)
    return {
        "code": -32000,
        "message": str(refused),
        "data": json.loads(encode({"kind": kind, **refused.data})),
    }


def test_why_a_goal_failed_is_said_in_the_readers_language(page: Any, served: str) -> None:
    """The state and its reason, with what the reason is made of."""
    with_pseudo_language(page)
    daemon = opened(page, served, "qps")
    page.locator("#tab-goals").click()
    in_the_way = Sentence("navigation.in_the_way", "something is in the way{where}", where="")
    noisy = Sentence("navigation.noisy", "the lidar is noisy: {share_percent:.0f}%", share_percent=12.0)
    why = join_sentences((in_the_way, noisy))
    reason = Sentence("navigation.blocked_for", "blocked for {seconds:.0f} s: {why}", seconds=30, why=why)
    daemon.say("navigation", **plain(NavigationData("blocked", None, reason)))
    sync_api.expect(page.locator("#goal-told")).to_contain_text("[šöméthïñg ïš ïñ thé wàý")
    assert untranslated(page, "#goal-told") == ""


def test_a_camera_that_is_unplugged_is_said_in_the_readers_language(page: Any, served: str) -> None:
    """Though the reason comes within a refusal, and is of the device."""
    page.set_viewport_size(PHONE)
    with_pseudo_language(page)
    device = "top"
    why = Sentence("camera.unplugged", "{device} is gone: was the camera unplugged?", device=device)
    WithCamera.error = said(
        RefusalKind.NO_PICTURE, Sentence("camera.no_picture", "no picture: {why}", why=why)
    )
    opened(page, served, "qps", WithCamera)
    page.locator("#tab-camera").click()
    sync_api.expect(page.locator("#camera-told")).to_contain_text("wàš thé çàmérà üñplüggéd")
    assert untranslated(page, "#camera-told") == ""


@pytest.mark.parametrize("language", ["qps", "de"])
def test_a_long_reason_is_not_cut_on_a_phone(page: Any, served: str, language: str) -> None:
    """The longest that the safety card has to say, in German too, at 360 pixels."""
    page.set_viewport_size(PHONE)
    with_pseudo_language(page)
    daemon = opened(page, served, language)
    daemon.say("safety", **stopped(jumping_wheels(), "encoder_jumps"))
    sync_api.expect(page.locator("#mode-reason")).to_contain_text(
        "Wackelkontakt" if language == "de" else "çöñtàçt"
    )
    assert page.evaluate(CUT) == []
    for button in ("estop", "stop"):
        sync_api.expect(page.locator(f"#{button}")).to_be_in_viewport(ratio=1)


def test_figures_have_the_languages_decimal_sign(page: Any, served: str) -> None:
    """A comma in German, in what the page says itself and in a sentence of the daemon."""
    daemon = opened(page, served, "de")
    low = Sentence(
        "driving.battery_critical",
        "the battery is critically low ({voltage_v:.1f} V): charge it",
        voltage_v=10.42,
    )
    daemon.say("safety", **stopped(low, "battery_critical"))
    sync_api.expect(page.locator("#mode-reason")).to_contain_text("(10,42 V)")
    sync_api.expect(page.locator("#battery")).to_contain_text("12,1 V")


def test_the_robots_own_drivers_have_words(page: Any, served: str) -> None:
    """A client's own name stays."""
    daemon = opened(page, served, "de")
    data = {"mode": "armed", "reason": "", "armed": True, "source": None, "limited_by": None}
    daemon.say("safety", **data, control={"navigation": "the robot's own navigation", "teleop": "Ann"})
    drivers = page.locator("#drivers")
    sync_api.expect(drivers).to_have_text("die Navigation des Roboters, Ann (das Fahren von Hand)")
