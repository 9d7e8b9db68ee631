"""A recorded calibration, replayed, and calibrated from once more."""

import asyncio
import contextlib
import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from chefbotd.cli.programs.chefbotctl import main
from chefbotd.client import CallError
from chefbotd.components.calibration.algorithms import steps
from chefbotd.components.calibration.algorithms.step import (
    Ask,
    ConfiguredRobot,
    Estimate,
    Measurements,
    Move,
    Procedure,
    Status,
    StepDefinition,
    StepResult,
)
from chefbotd.components.calibration.cli import recorded as from_recording
from chefbotd.components.calibration.events import CalibrationChanged
from chefbotd.core.geometry import Twist2D
from chefbotd.settings import load
from chefbotd.testing.daemon import SimulatedRobot
from tests.chefbotd.components.recording.replay.recordings import recorded, recorded_file, replayed
from tests.robot_files import full


def _procedure(robot: ConfiguredRobot) -> Procedure:
    yield Move(Twist2D(0.2, 0.5), 1.3, "drives", 0.5)
    yield Ask("voltage_v", "What does a voltmeter say?", "V", 5.0, 20.0, 0.9)
    yield Move(Twist2D(-0.1, 0.0), 0.7, "drives back", 1.0)


def _fit(robot: ConfiguredRobot, measured: Measurements) -> StepResult:
    """As many counts as there were readings: another recording is another number."""
    value = 1 + len(measured.wheels) / 1e4 + sum(wheels.travel_rad[0] for wheels in measured.wheels) / 1e3
    return StepResult(
        "wheels", Status.PASSED, "", (Estimate("chassis.track_multiplier", "", 1.0, value, 0.01),)
    )


@pytest.fixture(autouse=True)
def _steps(monkeypatch: pytest.MonkeyPatch) -> None:
    step = StepDefinition("wheels", "nothing", "nothing", 0.0, lambda robot: "", _procedure, _fit)
    monkeypatch.setattr(steps, "STEPS", {"wheels": step})
    monkeypatch.setattr(from_recording, "STEPS", {"wheels": step})


async def calibrate(robot: SimulatedRobot) -> None:
    """A step with an answer, and one that is stopped."""
    client = robot.client
    await asyncio.sleep(1.0)
    calibrating = asyncio.create_task(client.calibrate("wheels"))
    await asyncio.sleep(4.1)
    await client.answer_calibration("voltage_v", 12.25)
    await calibrating
    await asyncio.sleep(0.3)
    calibrating = asyncio.create_task(client.calibrate("wheels"))
    await asyncio.sleep(0.73)
    await client.stop()
    with contextlib.suppress(CallError):
        await calibrating
    await asyncio.sleep(0.7)


def test_a_calibration_is_replayed_bit_for_bit() -> None:
    """The motions, the answer, the result and the stop: the replay computes every event again, and no fit."""
    settings = load()
    events = recorded(calibrate, settings)
    told = [event for event in events if isinstance(event, CalibrationChanged)]
    assert {event.state for event in told} == {"idle", "moving", "asking", "computing"}
    assert told[-1].results[0].estimates[0].after > 1
    outcome = replayed(events, settings)
    assert outcome.problems == []
    assert outcome.first is None, str(outcome.first)
    assert outcome.exact
    assert outcome.comparison.rows["CalibrationChanged"].recorded == len(told)


def test_a_recorded_drive_is_calibrated_from_with_the_same_result_each_time(tmp_path: Path) -> None:
    """Twice the same JSON; with ``--apply --config`` the configuration that was named is written."""
    path = recorded_file(calibrate, load(), tmp_path)
    config = tmp_path / "robot.toml"
    config.write_bytes(full().read_bytes())
    command = ["--json", "calibrate", "--from", str(path), "wheels"]
    first, second = (CliRunner().invoke(main, command) for _ in range(2))
    assert first.exit_code == 0
    assert first.output == second.output
    after = json.loads(first.output)["results"][0]["estimates"][0]["after"]
    applied = CliRunner().invoke(main, [*command, "--apply", "--config", str(config)])
    assert applied.exit_code == 0
    assert load(config).chassis.track_multiplier == pytest.approx(after, abs=1e-5)
