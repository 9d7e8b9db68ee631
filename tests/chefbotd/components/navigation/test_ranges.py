"""From an ultrasonic sensor's echo on the bus to the costs that the worker plans with."""

import asyncio
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from chefbotd.bus import Bus
from chefbotd.clock import LoopClock, ManualClock, run_virtual
from chefbotd.components.localization.algorithms.state import PoseState
from chefbotd.components.localization.edited_map import EditedMap
from chefbotd.components.localization.skill import LocalizationSkill
from chefbotd.components.navigation import build
from chefbotd.components.navigation import skill as navigation_skill
from chefbotd.components.navigation import skill_requests as messages
from chefbotd.components.navigation.events import PlanResult
from chefbotd.components.navigation.parameters import NavigationSection
from chefbotd.components.navigation.skill import NavigationSkill
from chefbotd.components.worker.messages import Measured, event_in, pack_body
from chefbotd.components.worker.parameters import WorkerParameters
from chefbotd.components.worker.service import WorkerService
from chefbotd.components.zones.zone_file import NO_ZONES
from chefbotd.core.events import OdometryUpdated, RangeMeasured, RangeStatus
from chefbotd.core.geometry import CERTAIN, STANDING, Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.record import replace
from chefbotd.settings import load
from tests.fakes.worker import Nursery, healthy

MOUNT = Pose2D(0.1, -0.04, 0.3)
STANDS = OdometryUpdated(50.0, 50.0, Pose2D(0.2), STANDING, CERTAIN)


def echo(range_m: float | None, status: RangeStatus = RangeStatus.OK, sensor: str = "front") -> RangeMeasured:
    """One reading of a sensor with a cone of 15 degrees."""
    return RangeMeasured(2.0, 2.01, sensor, status, range_m, 0.02, 4.0, 0.26)


def test_only_an_echo_is_sent_to_the_worker() -> None:
    """What gave no echo says nothing."""

    async def scenario() -> None:
        bus, nursery = Bus(), Nursery(healthy)
        service = WorkerService(bus, LoopClock(), WorkerParameters(), {}, nursery.spawn)
        running = asyncio.create_task(service.run())
        await asyncio.sleep(1.0)
        for status in (RangeStatus.NO_ECHO, RangeStatus.OK, RangeStatus.TOO_FAR):
            bus.publish(echo(0.8 if status is RangeStatus.OK else None, status))
        await asyncio.sleep(0.1)
        assert [event_in(message) for message in nursery.last.received_of(Measured)] == [echo(0.8)]
        running.cancel()
        await asyncio.wait({running})

    run_virtual(scenario())


class Located(LocalizationSkill):
    """A robot that knows where it is: ``odom`` lies at (1.0, 0.8) in an empty map of 4 by 4 m, turned by 0.2."""

    def __init__(self) -> None:
        grid = OccupancyGrid(0.05, Pose2D(), np.zeros((80, 80), np.int8))
        self.edited = EditedMap(grid, None, grid)
        self._map, self.seen = ("room", 1), None
        self._within = SimpleNamespace()  # type: ignore[assignment]
        self.report = SimpleNamespace(map_from_odom=np.array([1.0, 0.8, 0.2]), state=PoseState.LOCALIZED)  # type: ignore[assignment]

    problem = ""  # nothing is wrong with the lidar's mount


def test_the_skill_plans_round_what_a_sensor_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    """The robot is at (0.2, 0) by odometry, its sensor looks left: the straight way past the echo is closed."""
    monkeypatch.setattr(navigation_skill, "read_zones", lambda folder, name: NO_ZONES)
    clock = ManualClock(50.0)
    told = messages.NavigationSkillParameters(
        folder=Path("/nowhere"),
        radius_m=0.18,
        half_length_m=0.18,
        half_width_m=0.18,
        navigation=NavigationSection(),
        silent_speed_m_s=0.06,
        range_mounts={"front": (MOUNT.x_m, MOUNT.y_m, MOUNT.heading_rad)},
    )
    skill = NavigationSkill(told.model_dump_json().encode(), clock)
    finder = Located()
    skill.connect({"localization": finder})
    skill.take_odometry(STANDS)
    pose = Pose2D(1.0, 0.8, 0.2).compose(Pose2D(0.2, 0.0))
    there = pose.compose(MOUNT).compose(Pose2D(0.9, 0.0))
    beyond = pose.compose(MOUNT).compose(Pose2D(2.0, 0.0))
    asked = messages.PlanTo(messages.GoalAsked(1, beyond.x_m, beyond.y_m, None, 0.0))

    def nearest_m() -> float:
        answer = skill.handle(pack_body(asked))
        assert isinstance(answer, PlanResult)
        assert answer.possible, answer.reason
        return float(np.hypot(np.array(answer.x_m) - there.x_m, np.array(answer.y_m) - there.y_m).min())

    assert nearest_m() < 0.06
    assert list(skill.take_range(replace(echo(0.9, sensor="rear"), stamp_s=50.0))) == []
    assert nearest_m() < 0.06, "nobody knows where that sensor is"
    assert list(skill.take_range(replace(echo(0.9), stamp_s=50.0))) == []
    assert nearest_m() > 0.2
    finder.report.state = PoseState.LOST  # type: ignore[union-attr,misc]
    skill.take_range(replace(echo(0.9), stamp_s=60.0))
    finder.report.state = PoseState.LOCALIZED  # type: ignore[union-attr,misc]
    clock.advance(10.0)
    skill.take_odometry(replace(STANDS, stamp_s=60.0))
    assert nearest_m() < 0.06


@pytest.mark.parametrize(("key", "possible"), [(None, False), ("avoided", True), ("free", True)])
def test_unknown_space_is_driven_if_the_configuration_says_so(
    monkeypatch: pytest.MonkeyPatch, key: str | None, possible: bool
) -> None:
    """A goal beyond 0.5 m that the map knows nothing of: no way, unless ``navigation.unknown_space`` allows it."""
    monkeypatch.setattr(navigation_skill, "read_zones", lambda folder, name: NO_ZONES)
    settings = load(overrides={} if key is None else {"navigation.unknown_space": key})
    told = build.navigation_skill_parameters(settings, Path("/nowhere"))
    skill = NavigationSkill(told.model_dump_json().encode(), ManualClock(50.0))
    finder = Located()
    assert finder.edited is not None
    finder.edited.grid.percent[:, 50:60] = -1
    skill.connect({"localization": finder})
    skill.take_odometry(STANDS)
    answer = skill.handle(pack_body(messages.PlanTo(messages.GoalAsked(1, 3.4, 1.0, None, 0.0))))
    assert isinstance(answer, PlanResult)
    assert answer.possible is possible


def test_the_skill_drives_no_faster_than_the_wheels_can() -> None:
    """A tenth of the wheels' speed is for corrections; the rest of the section is handed over as it is."""
    settings = load(overrides={"navigation.max_speed_m_s": 9.0, "navigation.comfort_m": 0.5})
    told = build.navigation_skill_parameters(settings, Path("/nowhere")).navigation
    assert told.max_speed_m_s == pytest.approx(0.9 * settings.drive.max_rim_speed_m_s)
    assert told.comfort_m == 0.5
