"""docs/adding_a_sensor.md and docs/adding_a_skill.md show code that works as it stands, and files that are there."""

import re
import sys
import types
from pathlib import Path

import msgspec
import pytest

from chefbotd.bus import Bus
from chefbotd.clock import ManualClock
from chefbotd.components.worker import runner
from chefbotd.components.worker.messages import (
    Answer,
    Configure,
    Failed,
    Ready,
    SkillEvent,
    SkillRequest,
    make_measured,
    pack_body,
)
from chefbotd.core.events import RangeStatus
from chefbotd.core.events.robot import OdometryUpdated
from chefbotd.core.geometry import CERTAIN, STANDING, Pose2D, Twist2D
from chefbotd.driving.obstacle_guard import ObstacleGuard
from chefbotd.safety.guard import GuardParameters

DOCS = Path(__file__).parents[2] / "docs"
pytestmark = pytest.mark.skipif(
    not DOCS.exists(), reason="the documentation is not part of an installed package"
)


def shown(name: str, monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    """A page's code as a module."""
    (code,) = re.findall(r"```python\n(.*?)```", (DOCS / name).read_text(encoding="utf-8"), re.DOTALL)
    module = types.ModuleType("page")
    monkeypatch.setitem(sys.modules, "page", module)
    exec(compile(code, name, "exec"), vars(module))
    return module


def test_the_sensor_of_the_page_stops_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Something 0.12 m ahead of a sensor on the nose: no step forward, but back and round; a free way lets it go."""
    page = shown("adding_a_sensor.md", monkeypatch)
    bus, nose = Bus(), page.TimeOfFlightParameters(mount_x_m=0.16)
    failures: list[Exception] = []
    guard = ObstacleGuard(bus, GuardParameters(), {nose.name: nose.base_from_sensor}, None, failures.append)
    page.connect(nose, bus)
    bus.publish(page.FlightTimed(10.0, 10.0, "nose", 120))
    assert guard.limit(Twist2D(0.3, 0.0), 10.02) == (Twist2D(0.0, 0.0), "obstacle:nose")
    assert guard.limit(Twist2D(-0.3, 0.0), 10.02) == (Twist2D(-0.3, 0.0), None)
    for reading in range(5):  # one alone would be a miss
        assert guard.limit(Twist2D(0.3, 0.0), 10.02)[0] == Twist2D(0.0, 0.0), reading
        bus.publish(page.FlightTimed(10.1, 10.1, "nose", 3200))
    assert guard.limit(Twist2D(0.3, 0.0), 10.12) == (Twist2D(0.3, 0.0), None)
    bus.publish(page.FlightTimed(10.2, 10.2, "nose", 30))
    assert guard.limit(Twist2D(0.3, 0.0), 10.22)[0] == Twist2D(0.0, 0.0)
    assert failures == []


@pytest.mark.parametrize(
    ("distance_mm", "status"),
    [
        (0, RangeStatus.NO_ECHO),
        (39, RangeStatus.TOO_NEAR),
        (40, RangeStatus.OK),
        (3600, RangeStatus.OK),
        (3601, RangeStatus.TOO_FAR),
    ],
)
def test_the_band_of_the_sensor_of_the_page(
    monkeypatch: pytest.MonkeyPatch, distance_mm: int, status: RangeStatus
) -> None:
    """From 0.04 to 3.6 m there is a distance, and nowhere else."""
    page = shown("adding_a_sensor.md", monkeypatch)
    timed = page.FlightTimed(1.0, 1.0, "nose", distance_mm)
    measured = page.interpret(page.TimeOfFlightParameters(), timed)
    assert measured.status is status
    assert measured.range_m == (distance_mm / 1000 if status is RangeStatus.OK else None)


def test_the_skill_of_the_page_runs_in_a_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    """0.3 and 0.4 m across are 0.5 m; a jump of 2 m counts for nothing; asked, it begins again from 0."""
    page = shown("adding_a_skill.md", monkeypatch)
    worker = runner.Runner(ManualClock(0.0))
    *_, ready = worker.take_message(Configure({"distance": b"{}"}, {"distance": "page:DistanceSkill"}))
    assert ready == Ready()
    (refused,) = worker.take_message(SkillRequest(1, "distance", 5.0, pack_body(page.StartOver())))
    assert isinstance(refused, Failed)
    assert refused.message == "there is no odometry yet"
    told: list[SkillEvent] = []
    for stamp_s, x_m, y_m in ((0.0, 0.0, 0.0), (0.1, 0.3, 0.4), (0.2, 2.3, 0.4), (0.3, 2.3, 0.5)):
        odometry = OdometryUpdated(stamp_s, stamp_s, Pose2D(x_m, y_m), STANDING, CERTAIN)
        told += [
            each for each in worker.take_message(make_measured(odometry)) if isinstance(each, SkillEvent)
        ]
    driven = [msgspec.msgpack.decode(each.body, type=page.DistanceDriven) for each in told]
    assert [(each.stamp_s, each.distance_m) for each in driven] == [
        (0.1, pytest.approx(0.5)),
        (0.3, pytest.approx(0.6)),
    ]
    assert {each.kind for each in told} == {"DistanceDriven"}
    (answer,) = worker.take_message(SkillRequest(2, "distance", 5.0, pack_body(page.StartOver())))
    assert answer == Answer(2, pack_body(page.DistanceDriven(0.3, 0.0)))


@pytest.mark.parametrize(("name", "most"), [("adding_a_sensor.md", 12), ("adding_a_skill.md", 8)])
def test_the_files_that_a_page_names_are_there(name: str, most: int) -> None:
    """But for those that are to be written; a sensor that stops the robot touches twelve at most."""
    text = (DOCS / name).read_text(encoding="utf-8")
    named = re.findall(r"^\| `((?:chefbotd|tests|firmware_protocol)/[^`]+)`", text, re.MULTILINE)
    assert 0 < len(named) <= most
    there = [path for path in named if "your_" not in path]
    assert [path for path in there if not (DOCS.parent / path).exists()] == []
