"""What needs a hand: a robot that is moved, a box before it, and a lidar that sits the wrong way round."""

import asyncio
import math

import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.doctor.algorithms.finding import Finding, Verdict
from chefbotd.components.doctor.cli.asked import examine_with_help
from chefbotd.settings import Settings, load
from tests.chefbotd.components.doctor.cli.bench import Answers, bench, configured, diagnosis_of, found

pytestmark = pytest.mark.slow


def with_lidar(yaw_rad: float, *, upside_down: bool = False) -> Settings:
    """ChefBot with an LD19 that looks so."""
    plain = load()
    from chefbotd.sensing.lidar import LidarParameters

    lidar = LidarParameters.model_validate(
        {
            "model": "ld19",
            "device": "/dev/lidar",
            "mount_x_m": 0.05,
            "mount_yaw_rad": yaw_rad,
            "upside_down": upside_down,
        }
    )
    return plain.model_copy(update={"lidar": (lidar,)})


def helped(believed: Settings, real: Settings, asker: Answers) -> dict[str, Finding]:
    """The findings of a diagnosis with somebody who lets the robot drive itself, and puts a box before it."""

    async def scenario() -> dict[str, Finding]:
        diagnosis = diagnosis_of(believed, asker, motors=True)
        async with bench(believed, real) as robot:

            async def place() -> None:
                pose = robot.board.truth(0.0).world_from_base
                cos, sin = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
                robot.board.crowd.put("box", pose.x_m + 0.62 * cos, pose.y_m + 0.62 * sin, 0.12)
                await asyncio.sleep(0.3)

            asker.doing["Place a box"] = place
            await examine_with_help(diagnosis, robot.robot)
        return found(diagnosis)

    return run_virtual(scenario())


DRIVES = {
    "straight ahead on the floor": "yes",
    "in centimetres": "30",
    "on the spot": "yes",
    "Place a box": "",
}


def test_a_lidar_that_looks_where_its_mount_says():
    """Forward, to the left, and with a box ahead: the scans agree with odometry, and odometry with the ruler."""
    findings = helped(with_lidar(0.4), with_lidar(0.4), Answers(dict(DRIVES)))
    bad = [each for each in findings.values() if each.verdict in (Verdict.WARNING, Verdict.PROBLEM)]
    assert not bad
    assert {"lidar_forward lidar", "lidar_turn lidar", "lidar_ahead lidar", "ahead front", "distance"} <= set(
        findings
    )


def test_a_lidar_that_is_turned_by_half():
    """It sits the wrong way round: the drive forward and the box both tell, and what to set."""
    findings = helped(with_lidar(0.4), with_lidar(0.4 + math.pi), Answers(dict(DRIVES)))
    forward, ahead = findings["lidar_forward lidar"], findings["lidar_ahead lidar"]
    assert forward.verdict is Verdict.PROBLEM
    assert "mount_yaw_rad = -2.7" in forward.advice  # 0.4 + pi, wrapped
    assert ahead.verdict is Verdict.PROBLEM
    assert "wrong way round" in ahead.advice


def test_a_lidar_that_hangs_upside_down():
    """A turn to the left tells that it sees the room mirrored."""
    findings = helped(with_lidar(0.4), with_lidar(0.4, upside_down=True), Answers(dict(DRIVES)))
    finding = findings["lidar_turn lidar"]
    assert finding.verdict is Verdict.PROBLEM
    assert "upside_down" in finding.advice


def test_nobody_is_there():
    """All of it is skipped, and says so; the robot has not moved."""

    async def scenario() -> None:
        diagnosis = diagnosis_of(configured(), Answers(), motors=True)
        async with bench(configured()) as robot:
            before = robot.board.truth(0.0).world_from_base
            await examine_with_help(diagnosis, robot.robot)
            assert robot.board.truth(0.0).world_from_base == before
        assert {each.verdict for each in diagnosis.findings} == {Verdict.SKIPPED}

    run_virtual(scenario())


def test_a_yes_without_motors_moves_nothing():
    """Who did not start the doctor with --motors may type yes: the question does not offer it, and nothing drives."""

    async def scenario() -> None:
        asker = Answers({"straight ahead": "yes", "on the spot": "yes"})
        diagnosis = diagnosis_of(configured(), asker)
        async with bench(configured()) as robot:
            await examine_with_help(diagnosis, robot.robot)
            assert robot.board.duty == (0, 0)
        assert not any("type yes" in question for question in asker.asked)
        assert (
            found(diagnosis)["encoders"].verdict is Verdict.PROBLEM
        )  # nothing was pushed, though Enter says so

    run_virtual(scenario())
