"""A stranger's component, in a distribution of its own (tests/stranger), comes through the door as ours do."""

import asyncio
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from structlog.testing import capture_logs

from chefbotd.cli.common.state_text import of_state
from chefbotd.cli.common.strangers import strangers_rows
from chefbotd.cli.programs import chefbotctl, chefbotd
from chefbotd.client import CallError
from chefbotd.components.doctor.cli.bundle import secrets_of
from chefbotd.components.recording.replay.recorded import Recorded, groups_of
from chefbotd.components.recording.replay.run import ReplayOptions, replay_groups, settings_of
from chefbotd.event_classes import encode
from chefbotd.settings import Settings, SettingsError, load
from chefbotd.testing.daemon import SimulatedRobot
from chefbotd.testing.worker import worker_in_process
from tests.chefbotd.components.recording.replay.recordings import recorded

STRANGER = Path(__file__).parents[1] / "stranger"
ROBOT = """
extends = "chefbot"
plugins.allow = ["pressure"]

[api]
port = 0

[pressure]
file = "hpa"
password = "open-sesame-please"
"""
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Writes a robot's file beside the sensor's, while the stranger's distribution is installed."""
    monkeypatch.syspath_prepend(str(STRANGER))
    (tmp_path / "hpa").write_text("1000.0")

    def write(text: str = ROBOT, more: str = "") -> Path:
        path = tmp_path / "robot.toml"
        path.write_text(text + more)
        return path

    return write


def refusal(path: Path) -> str:
    """Why the configuration is refused."""
    with pytest.raises(SettingsError) as error:
        load(path)
    return str(error.value)


def test_check_config_knows_the_section_and_prints_no_secret_of_it(write: Write) -> None:
    """Its keys, with their defaults, and a path from the configuration's folder."""
    path = write()
    done = CliRunner().invoke(chefbotd.main, ["check-config", str(path), "--all"])
    assert done.exit_code == 0, done.output
    lines = done.output.splitlines()
    assert f'pressure.file = "{path.parent / "hpa"}"' in lines
    assert "pressure.rise_hpa = 0.5" in lines
    assert "sesame" not in done.output
    assert list(secrets_of(load(path))) == ["open-sesame-please"]


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ("rise = 2.0\n", "pressure.rise: unknown key, did you mean rise_hpa?"),
        ("rise_hpa = -1\n", "pressure.rise_hpa: input should be greater than 0 (got -1)"),
        ("period_s = 11\n", "pressure.period_s: input should be less than or equal to 10 (got 11)"),
        ("[api]\nrequest_timeout_s = 0.05\n", "[pressure] period_s 0.1 is longer than api.request_timeout_s"),
        ("[plugins.settings]\npressure = {}\n", "its keys stand in a section of their own, [pressure]"),
    ],
)
def test_a_bad_key_of_its_section_is_refused_by_its_name(write: Write, more: str, reason: str) -> None:
    """As one of ours is."""
    text = ROBOT.replace("[api]\nport = 0\n", "") if "[api]" in more else ROBOT
    text = text.replace("plugins.allow", "[plugins]\nallow") if "[plugins" in more else text
    assert reason in refusal(write(text, more))


def test_a_secret_that_is_refused_is_not_repeated(write: Write) -> None:
    """Whatever was wrong with it."""
    text = refusal(write(ROBOT.replace('"open-sesame-please"', "314159265")))
    assert "pressure.password: input should be a valid string" in text
    assert "314159265" not in text


def test_a_section_of_a_component_that_is_not_allowed_is_refused_with_what_to_do(write: Write) -> None:
    """An installed package does nothing in a daemon before it is allowed there."""
    text = refusal(write(ROBOT.replace('plugins.allow = ["pressure"]', "")))
    assert "pressure: unknown key; it is the section of an installed component, which is not allowed" in text


def test_what_it_publishes_is_recorded_and_replayed_bit_for_bit(write: Write) -> None:
    """What came from outside, from the worker's skill and from requests comes in again; what follows is the same."""
    path = write()
    settings = load(path)
    sensor = path.parent / "hpa"

    async def script(robot: SimulatedRobot) -> None:
        await robot.client.wait_until_armed()
        for hpa in (1000.0, 1000.7, 1000.9, 1001.3):
            sensor.write_text(str(hpa))
            for _ in range(5):
                await robot.client.drive(0.2, 0.0)
                await asyncio.sleep(0.1)
        assert (await robot.client.call("reset_pressure"))["rises"] == 2
        sensor.write_text("1002.0")
        await asyncio.sleep(0.3)

    events = recorded(script, settings, worker_in_process)
    rises = [event for event in events if type(event).__name__ == "PressureRose"]
    assert [(rise.pressure_hpa, rise.rises) for rise in rises] == [(1000.7, 1), (1001.3, 2), (1002.0, 1)]
    assert 0.0 < rises[0].driven_m < rises[1].driven_m < rises[2].driven_m < 0.5
    assert {"PressureMeasured", "WorkerSaid"} <= {type(event).__name__ for event in events}
    stream = [Recorded(k + 1, type(event).__name__, encode(event)) for k, event in enumerate(events)]
    sensor.write_text("not a number")  # a replay asks no sensor
    again = settings_of(settings.model_dump_json(by_alias=True))
    assert again.model_dump()["pressure"]["rise_hpa"] == 0.5
    first, *others = groups_of(iter(stream))
    outcome = asyncio.run(replay_groups(again, first, iter(others), ReplayOptions()))
    assert (outcome.exact, outcome.first, outcome.problems) == (True, None, [])


def with_robot(settings: Settings, script: Callable[[SimulatedRobot], Any]) -> None:
    """Run the script on the simulated robot, whose worker runs on the same clock."""
    recorded(script, settings, worker_in_process)


def test_it_drives_as_the_source_of_its_name_where_the_configuration_has_it(write: Write) -> None:
    """Without the source it is refused; with it the robot moves, and the topic ``safety`` names the driver."""

    async def refused(robot: SimulatedRobot) -> None:
        await robot.client.wait_until_armed()
        with pytest.raises(CallError):
            await robot.client.call("creep")

    async def moves(robot: SimulatedRobot) -> None:
        await robot.client.wait_until_armed()
        for _ in range(5):
            await robot.client.call("creep")
            await asyncio.sleep(0.2)
        assert robot.board.truth(robot.now_s()).world_from_base.x_m > 0.02
        assert "the robot's own pressure" in json.dumps(await robot.client.call("get_state"))

    with_robot(load(write()), refused)
    source = "[safety.sources.pressure]\npriority = 5\ntimeout_s = 0.5\n"
    with_robot(load(write(more=source)), moves)


def test_chefbotctl_has_its_command_and_its_row_of_the_status(write: Write) -> None:
    """The command is found by its name, and listed; the row stands behind the battery's."""
    write()
    listed = CliRunner().invoke(chefbotctl.main, ["--help"])
    assert re.search(r"^  pressure +Count the rises", listed.output, re.MULTILINE)
    unreached = CliRunner().invoke(chefbotctl.main, ["--connect", "127.0.0.1:1", "pressure"])
    assert unreached.exit_code != 2, unreached.output
    battery = {"voltage_v": 7.4, "percentage": 50.0, "status": "ok"}
    pressed = {"pressure_hpa": 1001.25, "rises": 3, "driven_m": 0.5}
    topics = {"battery": {"data": battery, "age_s": 0.1}, "pressure": {"data": pressed, "age_s": 2.0}}
    state = {
        "safety": {"armed": False, "mode": "x", "reason": ""},
        "link": {"state": "down", "device": "", "reason": ""},
        "topics": topics,
        "plugins": [{"name": "pressure", "version": "1.0", "reason": ""}],
    }
    facts = of_state(state, strangers_rows(state["plugins"]))
    labels = [fact.label for fact in facts]
    assert labels.index("pressure") == labels.index("battery") + 1
    assert facts[labels.index("pressure")].text == "1001.2 hPa, 3 rises"
    assert facts[labels.index("pressure")].age_s == 2.0


def test_chefbotd_itself_has_no_word_of_it() -> None:
    """The stranger is a distribution of its own: chefbotd has no line for it."""
    sources = Path(chefbotd.__file__).parents[2].rglob("*.py")
    assert [path for path in sources if "pressure_hpa" in path.read_text(encoding="utf-8")] == []


def test_a_skill_of_a_stranger_that_fails_is_left_out_and_the_worker_goes_on(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The daemon's log says why, and the worker is not started again."""
    import chefbot_pressure.skill as skill

    def fail(self: object, odometry: object) -> Any:
        raise OSError("no wheel")

    monkeypatch.setattr(skill.DistanceSkill, "take_odometry", fail)

    async def script(robot: SimulatedRobot) -> None:
        await robot.client.wait_until_armed()
        await asyncio.sleep(1.0)
        worker = (await robot.client.call("get_state"))["topics"]["worker"]["data"]
        assert (worker["state"], worker["restarts"]) == ("ready", 0)

    with capture_logs() as lines:
        with_robot(load(write()), script)
    assert [(line["skill"], line["reason"]) for line in lines if line["event"] == "a skill is left out"] == [
        ("distance", "OSError: no wheel")
    ]


def test_a_component_with_a_check_that_fails_is_refused_with_its_name(
    write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing of a traceback reaches the user."""
    import chefbot_pressure.service as service

    def fail(section: object, settings: object) -> Any:
        raise KeyError("x")

    monkeypatch.setattr(service, "check", fail)
    assert "[pressure] its check fails: KeyError: 'x'" in refusal(write())


def test_a_section_of_a_component_that_cannot_be_imported_keeps_nothing_from_running(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The daemon is to run without it, whatever its section says; ``check-config`` says that it is left out."""
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path != str(STRANGER)])
    path = write()
    assert load(path).strangers[0].state == "not_found"
    done = subprocess.run(
        [sys.executable, "-c", "from chefbotd.start import chefbotd; chefbotd()", "check-config", str(path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Note: the component pressure is left out: no installed package has an entry point" in done.stderr
