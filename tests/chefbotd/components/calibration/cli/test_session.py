"""The command ``chefbotctl calibrate`` with a person who answers, on the simulated robot."""

import asyncio
import json
from collections.abc import Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.programs.chefbotctl import main
from chefbotd.client import CallError
from chefbotd.clock import run_virtual
from chefbotd.components.calibration.algorithms import steps
from chefbotd.components.calibration.algorithms.step import (
    Ask,
    ConfiguredRobot,
    Estimate,
    Measurements,
    Plot,
    Procedure,
    Residual,
    Series,
    Status,
    StepDefinition,
    StepResult,
)
from chefbotd.components.calibration.cli import recorded
from chefbotd.components.calibration.cli.session import CalibrationSession
from chefbotd.settings import load
from chefbotd.testing.daemon import simulated_robot
from tests.robot_files import full

KEY = "battery.divider_ratio"


def _asks(robot: ConfiguredRobot) -> Procedure:
    yield Ask("voltage_v", "What does a voltmeter say?", "V", 5.0, 20.0, 1.0)


def _fit(robot: ConfiguredRobot, measured: Measurements) -> StepResult:
    volts = measured.answers.get("voltage_v")
    if volts is None:
        return StepResult("battery", Status.NOT_ENOUGH, "nobody read a voltmeter")
    estimate = Estimate(KEY, "", robot.battery.divider_ratio, volts / 2.4, 0.01)
    plot = Plot(
        "Two readings", "time, s", "voltage, V", (Series("read", (0.0, 1.0), (12.0, 12.1), points=True),)
    )
    return StepResult(
        "battery", Status.PASSED, "", (estimate,), (Residual("voltage", "V", 0.4, 0.0, 1),), (plot,)
    )


@pytest.fixture(autouse=True)
def _steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step that asks, and one that this robot cannot take."""
    ready = StepDefinition("battery", "the divider", "Take a voltmeter.", 0.0, lambda robot: "", _asks, _fit)
    other = StepDefinition(
        "lidar", "the mount", "Nothing.", 0.0, lambda robot: "it has no lidar", _asks, _fit
    )
    both = {step.name: step for step in (ready, other)}
    monkeypatch.setattr(steps, "STEPS", both)
    monkeypatch.setattr(recorded, "STEPS", both)


class Person:
    """Answers from a list; then nobody is there."""

    def __init__(self, answers: Sequence[str]) -> None:
        self.answers, self.questions = list(answers), list[str]()

    async def ask(self, question: str) -> str | None:
        self.questions.append(question)
        return self.answers.pop(0) if self.answers else None


def calibrated(
    person: Person,
    capsys: pytest.CaptureFixture[str],
    *,
    names: tuple[str, ...] = (),
    config: Path | None = None,
    out: Path | None = None,
    applies: bool = False,
    as_json: bool = False,
    is_ready: bool = False,
) -> str:
    """What the command prints."""

    async def run() -> None:
        async with simulated_robot(config_file=config) as robot:
            await robot.client.arm()
            await asyncio.sleep(1.0)
            capsys.readouterr()  # the daemon's log so far
            host, port = await robot.daemon.server.address()
            context = CommandContext((host, port), as_json)  # type: ignore[arg-type]
            session = CalibrationSession(context, names, None, is_ready=is_ready)
            session._asker = person  # type: ignore[assignment]
            await session._with_robot(robot.client, None, out, applies=applies)

    run_virtual(run())
    return capsys.readouterr().out


def test_a_step_is_prepared_asked_for_and_shown(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The preparation first, then the question until the answer is a number in its bounds, then the result."""
    person = Person(["", "twelve", "124", "12,6"])
    said = calibrated(person, capsys, out=tmp_path / "plots")
    assert "Take a voltmeter." in person.questions[0]
    assert person.questions[1:] == ["What does a voltmeter say? (V)"] * 3
    assert "lidar: left out, it has no lidar" in said
    rows = [line.split() for line in said.splitlines()]
    at = rows.index(["[battery]"])
    assert rows[at + 1] == ["divider_ratio", "5", "5.25", "0.01"]
    assert "voltage: 0.4 before, 0 after, V (1 measurements)" in said
    assert "Nothing was written" in said
    assert (tmp_path / "plots" / "battery-two-readings.png").read_bytes().startswith(b"\x89PNG")


def test_a_step_that_the_robot_cannot_take_is_refused_before_anything_is_prepared(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Nobody is asked to draw a mark or to press Enter for it."""
    person = Person([""])
    with pytest.raises(CallError, match="lidar cannot be calibrated: it has no lidar"):
        calibrated(person, capsys, names=("lidar",))
    assert person.questions == []


def test_a_question_without_a_unit_has_no_brackets(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As "Type 1." when the robot stands on its mark."""

    def asks(robot: ConfiguredRobot) -> Procedure:
        yield Ask("voltage_v", "Type 1.", "", 1.0, 20.0, 1.0)

    ready = StepDefinition("battery", "the divider", "Take a voltmeter.", 0.0, lambda robot: "", asks, _fit)
    monkeypatch.setattr(steps, "STEPS", {"battery": ready})
    person = Person(["", "12.6"])
    calibrated(person, capsys)
    assert person.questions[1:] == ["Type 1."]


def _spacious(monkeypatch: pytest.MonkeyPatch) -> None:
    """The step needs 0.3 m of free floor."""
    ready = StepDefinition("battery", "the divider", "Take a voltmeter.", 0.3, lambda robot: "", _asks, _fit)
    monkeypatch.setattr(steps, "STEPS", {"battery": ready})


def test_free_floor_that_no_lidar_sees_is_asked_before_the_step_begins(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nonsense and too little are said with what is expected; nothing is refused after Enter."""
    _spacious(monkeypatch)
    person = Person(["", "much", "nan", "0.2", "0,5 m", "12.6"])
    said = calibrated(person, capsys)
    assert all("type how many metres are free" in question for question in person.questions[:5])
    assert "divider_ratio" in said


def test_without_anybody_to_ask_the_option_is_named_before_anything_begins(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """``--space`` with the number that the step needs."""
    _spacious(monkeypatch)
    with pytest.raises(ProgramError, match="--space M says so"):
        calibrated(Person([]), capsys)
    with pytest.raises(ProgramError, match="no lidar sees whether there is: --space 0"):
        calibrated(Person([]), capsys, is_ready=True)


def test_what_has_passed_is_written_on_request(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """``--apply`` shows the difference, where it was written, and where the old file is."""
    config = tmp_path / "robot.toml"
    config.write_bytes(full().read_bytes())
    said = calibrated(Person(["", "12.6"]), capsys, config=config, applies=True)
    assert "+divider_ratio = 5.25" in said
    assert f"Written to {config}; it was {config}.before." in said
    assert load(config).battery.divider_ratio == 5.25


@pytest.mark.parametrize("as_json", [False, True])
def test_a_step_that_is_refused_does_not_cost_the_results_before_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, *, as_json: bool
) -> None:
    """They are shown and written, and the failure is that of the step that was refused."""
    config = tmp_path / "robot.toml"
    config.write_bytes(full().read_bytes())
    with pytest.raises(CallError, match="it has no lidar"):
        calibrated(
            Person(["", "12.6", ""]),
            capsys,
            names=("battery", "lidar"),
            config=config,
            applies=True,
            as_json=as_json,
        )
    assert load(config).battery.divider_ratio == 5.25
    assert ("Written to" in capsys.readouterr().out) is not as_json


def test_nobody_there_moves_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    """Without somebody who presses Enter the step does not begin; without an answer it ends."""
    with pytest.raises(ProgramError, match="--yes says that everything is prepared"):
        calibrated(Person([]), capsys)
    with pytest.raises(CallError, match="stopped by"):
        calibrated(Person([""]), capsys)


def test_a_script_gets_the_result_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    """One object with all results, and nothing else."""
    said = calibrated(Person(["", "12.6"]), capsys, names=("battery",), as_json=True)
    answer = json.loads([line for line in said.splitlines() if line.startswith("{")][-1])
    assert answer["results"][0]["estimates"][0]["after"] == 5.25
    assert answer["applied"] is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--config", "pyproject.toml"], "--config names the file to write, which needs --apply"),
        (["--sim", "1", "wheels"], "--sim does every step"),
        (["wings"], "'wings' is not one of"),
        (["--space", "nan"], "'nan' is not finite"),
        (["--space", "-1"], "'-1' is not in the range 0 to 100 m"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(
    arguments: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each says what is wrong, and nothing is asked of any robot."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pyproject.toml").write_text("")
    result = CliRunner().invoke(main, ["calibrate", *arguments])
    assert result.exit_code == Exit.USAGE
    assert words in result.output


def test_a_daemon_that_could_not_write_is_told_of_before_anything_moves(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """With ``--apply`` and the packaged configuration nothing is asked for or driven, and what to do is said."""
    person = Person(["", "12.6"])
    with pytest.raises(ProgramError, match="chefbotd init FOLDER"):
        calibrated(person, capsys, applies=True)
    assert person.questions == []
