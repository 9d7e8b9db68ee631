"""A step of the calibration on the simulated robot: what it may do, what ends it, and what is written of it."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from chefbotd.client import CallError, Client
from chefbotd.clock import run_virtual
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
from chefbotd.components.calibration.build import robot_with
from chefbotd.components.calibration.measuring import as_calibrated
from chefbotd.core.events import BatteryMeasured, WheelsDriven, WheelsMeasured
from chefbotd.core.events.robot import BatteryLevelStatus
from chefbotd.core.geometry import Twist2D
from chefbotd.settings import load
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.robot_files import full

KEY = "chassis.track_multiplier"


def _forward(robot: ConfiguredRobot) -> Procedure:
    """Half a metre on, and a question."""
    measured = yield Move(Twist2D(0.2, 0.0), 2.0, "drives", 0.5)
    assert max(event.velocity_rad_s[0] for event in measured.wheels) > 1.0
    answered = yield Ask("voltage_v", "What does a voltmeter say?", "V", 5.0, 20.0, 1.0)
    assert answered.answers == {"voltage_v": 12.4}


class FakeStep:
    """A step whose estimate is told beforehand."""

    def __init__(self) -> None:
        self.after, self.sigma = 1.01, 0.001
        self.status, self.reason = Status.PASSED, ""
        self.got: Measurements | None = None

    def fit(self, robot: ConfiguredRobot, measured: Measurements) -> StepResult:
        self.got = measured
        estimate = Estimate(KEY, "", robot.chassis.track_multiplier, self.after, self.sigma)
        return StepResult("fake", self.status, self.reason, (estimate,))


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeStep:
    """Steps that a robot can begin, and one that it cannot."""
    fake = FakeStep()
    step = StepDefinition("fake", "nothing", "nothing", 0.0, lambda robot: "", _forward, fake.fit)
    wide = StepDefinition("wide", "nothing", "nothing", 0.4, lambda robot: "", _forward, fake.fit)
    none = StepDefinition(
        "none", "nothing", "nothing", 0.0, lambda robot: "it has no wings", _forward, fake.fit
    )
    monkeypatch.setattr(steps, "STEPS", {step.name: step for step in (step, wide, none)})
    return fake


def on_robot(scenario: Callable[[SimulatedRobot], Awaitable[None]], config_file: Path | None = None) -> None:
    """Run a scenario on the simulated ChefBot, armed."""

    async def run() -> None:
        async with simulated_robot(config_file=config_file) as robot:
            await robot.client.arm()
            await asyncio.sleep(1.0)
            await scenario(robot)

    run_virtual(run())


async def _answering(robot: Client, value: float = 12.4) -> None:
    """Answer the question as soon as it is asked."""
    async for event in robot.subscribe("calibration"):
        if event.data.question is not None:
            await robot.answer_calibration(event.data.question.key, value)
            return


async def _calibrated(robot: Client, step: str = "fake") -> StepResult:
    answering = asyncio.create_task(_answering(robot))
    try:
        return await robot.calibrate(step)
    finally:
        answering.cancel()


def test_a_step_drives_asks_and_answers_with_its_result(fake: FakeStep) -> None:
    """The robot has moved by what the step asked for, stands at its end, and its result is remembered."""

    async def scenario(robot: SimulatedRobot) -> None:
        result = await _calibrated(robot.client)
        now_s = asyncio.get_running_loop().time()
        truth = robot.board.truth(now_s)
        assert 0.3 < truth.world_from_base.compose(start.inverse()).x_m < 0.5
        assert abs(truth.twist.linear_m_s) < 1e-6
        assert result.estimates[0].after == 1.01
        assert fake.got is not None
        assert fake.got.answers == {"voltage_v": 12.4}
        assert len(fake.got.wheels) == len(fake.got.driven) > 40
        report = await robot.client.get_calibration()
        assert [result.step for result in report.results] == ["fake"]
        assert (await robot.client.get_state()).topics["calibration"].data.state == "idle"

    async def first(robot: SimulatedRobot) -> None:
        nonlocal start
        start = robot.board.truth(asyncio.get_running_loop().time()).world_from_base
        await scenario(robot)

    from chefbotd.core.geometry import ORIGIN

    start = ORIGIN
    on_robot(first)


@pytest.mark.parametrize("method", ["stop", "estop"])
def test_any_stop_ends_a_step(fake: FakeStep, method: str) -> None:
    """Somebody else's stop: the request is refused with who stopped it, the robot stands, and nothing is computed."""

    async def scenario(robot: SimulatedRobot) -> None:
        host, port = await robot.daemon.server.address()
        async with Client.connect(host, port) as other:
            calibrating = asyncio.create_task(robot.client.calibrate("fake"))
            await asyncio.sleep(1.0)
            await other.call(method)
            with pytest.raises(CallError, match=r"stopped|emergency"):
                await calibrating
            await asyncio.sleep(1.0)
            assert abs(robot.board.truth(asyncio.get_running_loop().time()).twist.linear_m_s) < 1e-6
            assert fake.got is None

    on_robot(scenario)


def test_a_step_ends_with_its_client(fake: FakeStep) -> None:
    """A connection that is lost in mid-step leaves a robot that stands, and another client may begin again."""

    async def scenario(robot: SimulatedRobot) -> None:
        host, port = await robot.daemon.server.address()
        async with Client.connect(host, port) as other:
            calibrating = asyncio.create_task(other.calibrate("fake"))
            await asyncio.sleep(1.0)
            with pytest.raises(CallError, match="fake is being carried out"):
                await robot.client.calibrate("fake")
        with pytest.raises((CallError, ConnectionError)):
            await calibrating
        await asyncio.sleep(1.5)
        assert abs(robot.board.truth(asyncio.get_running_loop().time()).twist.linear_m_s) < 1e-6
        assert (await _calibrated(robot.client)).status == "passed"

    on_robot(scenario)


def test_somebody_who_drives_takes_over(fake: FakeStep) -> None:
    """A person at the joystick is above the calibration, which ends."""

    async def scenario(robot: SimulatedRobot) -> None:
        calibrating = asyncio.create_task(robot.client.calibrate("fake"))
        await asyncio.sleep(1.0)
        await robot.client.drive(0.0, 0.1)
        with pytest.raises(CallError, match="teleop drives the robot"):
            await calibrating

    on_robot(scenario)


@pytest.mark.parametrize(
    ("step", "words"),
    [
        ("nonsense", "expected one of fake, wide, none"),
        ("none", "it has no wings"),
        ("wide", "needs 0.4 m of free"),
    ],
)
def test_what_cannot_be_begun_is_refused_before_anything_moves(fake: FakeStep, step: str, words: str) -> None:
    """An unknown step, one for which the robot lacks something, one without room: each says why."""

    async def scenario(robot: SimulatedRobot) -> None:
        with pytest.raises(CallError, match=words):
            await robot.client.calibrate(step)
        assert robot.daemon.driving.wheels.drive_state.duty == (0, 0)

    on_robot(scenario)


def test_an_answer_out_of_its_bounds_is_refused_and_the_question_stays(fake: FakeStep) -> None:
    """A typing error names the value and what was expected, and the next answer counts."""

    async def scenario(robot: SimulatedRobot) -> None:
        with pytest.raises(CallError, match="does not ask"):
            await robot.client.answer_calibration("voltage_v", 12.0)
        calibrating = asyncio.create_task(robot.client.calibrate("fake"))
        await asyncio.sleep(5.0)
        with pytest.raises(CallError, match="voltage_v is 124, expected 5 to 20 V"):
            await robot.client.answer_calibration("voltage_v", 124.0)
        await robot.client.answer_calibration("voltage_v", 12.4)
        assert (await calibrating).status == "passed"

    on_robot(scenario)


@pytest.mark.slow
def test_a_question_that_nobody_answers_ends_the_step(fake: FakeStep) -> None:
    """After five minutes the step is over, and says so."""

    async def scenario(robot: SimulatedRobot) -> None:
        with pytest.raises(CallError, match="nobody answered within 5 minutes"):
            await robot.client.calibrate("fake")

    on_robot(scenario)


def test_a_second_run_that_does_not_agree_says_so(fake: FakeStep) -> None:
    """1.01 and 1.02, each with a sigma of 0.001, are 7 sigma of their difference apart; 1.01 and 1.012 are 1.4."""

    async def scenario(robot: SimulatedRobot) -> None:
        assert (await _calibrated(robot.client)).reason == ""
        fake.after = 1.012
        assert (await _calibrated(robot.client)).reason == ""
        fake.after = 1.022
        reason = (await _calibrated(robot.client)).reason
        assert f"does not agree with the one before: {KEY} was 1.012, is 1.022" in reason

    on_robot(scenario)


def test_only_what_has_passed_is_written_and_only_when_asked(fake: FakeStep, tmp_path: Path) -> None:
    """The file changes with ``apply_calibration`` and not before; a step that was refused writes nothing."""
    config = tmp_path / "robot.toml"
    config.write_bytes(full().read_bytes())
    before, kept = config.read_bytes(), []

    async def scenario(robot: SimulatedRobot) -> None:
        with pytest.raises(CallError, match="no step has passed"):
            await robot.client.apply_calibration()
        fake.status, fake.reason = Status.REFUSED, "noise"
        await _calibrated(robot.client)
        with pytest.raises(CallError, match="fake: has not passed"):
            await robot.client.apply_calibration(["fake"])
        fake.status = Status.PASSED
        await _calibrated(robot.client)
        assert config.read_bytes() == before
        applied = await robot.client.apply_calibration()
        assert load(config).chassis.track_multiplier == 1.01
        assert "+track_multiplier = 1.01" in applied.difference
        kept.append(applied.kept)

    on_robot(scenario, config)
    assert Path(kept[0]).read_bytes() == before


def test_the_packaged_configuration_is_not_written_to(fake: FakeStep) -> None:
    """A daemon without a file of its own says how to make one."""

    async def scenario(robot: SimulatedRobot) -> None:
        await _calibrated(robot.client)
        with pytest.raises(CallError, match="chefbotd init"):
            await robot.client.apply_calibration()
        assert (await robot.client.get_calibration()).writes_to == ""

    on_robot(scenario)


def test_measurements_are_seen_with_the_results_of_other_steps() -> None:
    """Half the counts to a turn are twice the turns; a divider of 5.5 in place of 5 makes 12 V 13.2 V."""
    running = robot_with(load(), {})
    other = robot_with(load(), {"encoders.counts_per_turn": 2100.0, "battery.divider_ratio": 5.5})
    measured = Measurements(
        wheels=(WheelsMeasured(1.0, 1.0, 1.0, (1.0, 2.0), (0.1, 0.2), (3.0, 4.0)),),
        driven=(WheelsDriven(1.0, (1.0, 2.0), (3.0, 4.0), (5.0, 6.0), (7, 8)),),
        battery=(BatteryMeasured(12.0, 50.0, BatteryLevelStatus.OK, stamp_s=1.0, arrival_s=1.0),),
    )
    seen = as_calibrated(measured, running, other)
    assert seen.wheels[0].position_rad == (2.0, 4.0)
    assert seen.wheels[0].travel_rad == (0.2, 0.4)
    assert seen.wheels[0].velocity_rad_s == seen.driven[0].velocity_rad_s == (6.0, 8.0)
    assert seen.driven[0].duty == (7, 8)
    assert seen.battery[0].voltage_v == pytest.approx(13.2)
    assert as_calibrated(measured, running, running) is measured
