"""The skill that finds the way, by what it is given and asked, and what it tells; the disk is in memory."""

import math
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from chefbotd.clock import ManualClock
from chefbotd.components.localization.events import LocalizationChanged
from chefbotd.components.localization.parameters import LocalizationSection
from chefbotd.components.localization.pose_file import PoseOnDisk, SavedPose
from chefbotd.components.localization.skill import LocalizationSkill
from chefbotd.components.localization.skill_requests import (
    LocalizationRequest,
    LocalizationSkillParameters,
    Localize,
    SetPose,
    UseMap,
    UseNone,
)
from chefbotd.components.worker.messages import pack_body
from chefbotd.components.worker.skill import Job, Struct
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import MapPoseUpdated
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from tests.chefbotd.components.localization.algorithms.buildings import drawn
from tests.chefbotd.components.mapping.algorithms.slam.flat import furnished_flat
from tests.chefbotd.components.worker.skills.drives import TRUTH, measured, measured_by_two

FLAT = drawn(furnished_flat())


@dataclass
class Memory:
    """What keeps a pose; ``refuses`` is what is wrong with it."""

    kept: SavedPose | None = None
    writes: int = 0
    refuses: str = ""

    def read(self) -> SavedPose | None:
        """It."""
        return self.kept

    def write(self, pose: SavedPose) -> str:
        """Keep it."""
        self.writes += 1
        if not self.refuses:
            self.kept = pose
        return self.refuses


def read_map(name: str) -> OccupancyGrid:
    """The flat, and a map without walls."""
    if name == "flat":
        return FLAT
    return OccupancyGrid(0.05, Pose2D(), np.zeros((9, 9), np.int8))


def ended(job: Job) -> Struct:
    """What a job ends with."""
    while True:
        try:
            next(job)
        except StopIteration as end:
            answer: Struct = end.value
            return answer


class Bench:
    """A skill, its disk and its clock, and all that it has told."""

    def __init__(self, memory: Memory | None = None, lidars: tuple[str, ...] = ("top",)) -> None:
        self.clock, self.memory = ManualClock(50.0), memory or Memory()
        parameters = LocalizationSkillParameters(
            lidars=lidars,
            folder=Path("/nowhere"),
            localization=LocalizationSection(save_period_s=1.0),
        )
        data = parameters.model_dump_json().encode()
        self.edits: bytes | None = None
        self.skill = LocalizationSkill(data, self.clock, read_map, self.memory, lambda _: self.edits)
        self.told: list[LocalizationChanged] = []
        self.poses: list[MapPoseUpdated] = []

    def ask(self, request: LocalizationRequest) -> LocalizationChanged:
        """The answer."""
        answer = self.skill.handle(pack_body(request))
        if isinstance(answer, Generator):
            answer = ended(answer)
        assert isinstance(answer, LocalizationChanged)
        return answer

    def drive(self, first: int, last: int, turned_rad: float = 0.0, *, with_scans: bool = True) -> None:
        """A part of the tour, ten scans a second; the lidar is turned in its mount, and the configuration is not."""
        for message in measured(first, last):
            if isinstance(message, ScanMeasured) and not with_scans:
                continue
            if isinstance(message, ScanMeasured):
                mount = message.base_from_lidar
                turned = replace(mount, heading_rad=mount.heading_rad - turned_rad)
                message = replace(message, base_from_lidar=turned)
            if message.stamp_s > self.clock.now_s():
                self.clock.advance(message.stamp_s - self.clock.now_s())
            take = self.skill.take_scan if isinstance(message, ScanMeasured) else self.skill.take_odometry
            self._hear(take(message))  # type: ignore[operator]
            self._hear(self.skill.step(self.clock.now_s()))

    def drive_by_two(self, first: int, last: int, silent: str = "") -> None:
        """A part of the tour with a front and a rear lidar, one of which may be silent."""
        for message in measured_by_two(first, last):
            if message.stamp_s > self.clock.now_s():
                self.clock.advance(message.stamp_s - self.clock.now_s())
            if not isinstance(message, ScanMeasured):
                self._hear(self.skill.take_odometry(message))
            elif message.lidar != silent:
                self._hear(self.skill.take_scan(message))
            self._hear(self.skill.step(self.clock.now_s()))

    def _hear(self, told: Iterable[Struct]) -> None:
        for one in told:
            if isinstance(one, MapPoseUpdated):
                self.poses.append(one)
            else:
                assert isinstance(one, LocalizationChanged)
                self.told.append(one)


def off_m(bench: Bench, k: int) -> float:
    """How far the last pose, which came with the last state, is from where the robot was at scan ``k`` of the tour."""
    pose = bench.poses[-1]
    assert pose.stamp_s == bench.told[-1].stamp_s
    assert pose.state == bench.told[-1].state
    return math.dist((pose.map_from_base.x_m, pose.map_from_base.y_m), TRUTH[k][:2])


def test_it_finds_the_way_on_a_stored_map() -> None:
    """From a start that nobody tells, by a lidar that is mounted aside and turned: right within a second."""
    bench = Bench()
    assert bench.ask(UseMap("flat", 1)).state == "unknown"
    bench.drive(0, 40)
    assert bench.told[0].state == "searching"
    assert bench.told[-1].state == "localized"
    assert bench.told[-1].map == "flat"
    assert off_m(bench, 39) < 0.03
    assert bench.told[-1].fit > 0.9
    assert bench.told[-1].jumps == 1


def test_without_a_map_it_rests_and_refuses() -> None:
    """Nothing is told of scans, and a pose that is given has no map to be on."""
    bench = Bench()
    bench.drive(0, 5)
    assert bench.told == []
    for request in (SetPose(1.0, 2.0, 0.3), Localize()):
        with pytest.raises(Refused) as refused:
            bench.ask(request)
        assert refused.value.kind is RefusalKind.NO_MAP_LOADED


def test_the_pose_is_kept_and_used_after_a_restart() -> None:
    """The next worker starts where this one ended, 20 cm on: no search, right at once."""
    first = Bench()
    first.ask(UseMap("flat", 1))
    first.drive(0, 60)
    assert first.memory.writes >= 3
    first.skill.close()
    second = Bench(first.memory)
    assert second.ask(UseMap("flat", 1)).state == "uncertain"
    second.drive(61, 70)
    assert {told.state for told in second.told} == {"uncertain", "localized"}
    assert second.told[-1].state == "localized"
    assert off_m(second, 69) < 0.03


def test_a_robot_that_stands_keeps_its_pose_once() -> None:
    """An SD card is not worn out by a robot that stands: five seconds, one write."""
    bench = Bench()
    bench.ask(UseMap("flat", 1))
    x, y, heading = map(float, TRUTH[0])
    bench.ask(SetPose(x, y, heading))
    standing = list(measured(0, 1))
    for k in range(50):
        bench.clock.advance(0.1)
        for message in standing:
            stamp_s = 50.0 + 0.1 * k + 0.001 * standing.index(message)
            moved = replace(message, stamp_s=stamp_s)
            if isinstance(moved, ScanMeasured):
                moved = replace(moved, scan=replace(moved.scan, stamp_s=stamp_s))
            take = bench.skill.take_scan if isinstance(message, ScanMeasured) else bench.skill.take_odometry
            bench._hear(take(moved))  # type: ignore[operator]
        bench._hear(bench.skill.step(bench.clock.now_s()))
    assert bench.told[-1].state == "localized"
    assert bench.memory.writes == 1


def test_the_same_map_told_again_is_said_to_be_in_use_anew_and_the_pose_stays() -> None:
    """Its zones may have changed; another version of it takes the pose over, to be confirmed by three scans."""
    bench = Bench()
    bench.ask(UseMap("flat", 1))
    bench.drive(0, 40)
    used, writes = bench.skill.used, bench.memory.writes
    assert bench.ask(UseMap("flat", 1)).state == "localized"
    assert bench.skill.used == used
    assert bench.skill.used is not used
    assert bench.memory.writes == writes
    assert bench.ask(UseMap("flat", 2)).state == "uncertain"
    assert bench.memory.kept is not None
    assert math.dist((bench.memory.kept.x_m, bench.memory.kept.y_m), TRUTH[39][:2]) < 0.03
    bench.drive(41, 47)
    assert bench.told[-1].state == "localized"


def test_a_map_is_made_ready_in_steps_and_the_one_before_is_in_use_until_then() -> None:
    """Each step is told; where it is given up, nothing has changed, and where it fails there is no map."""
    bench = Bench()
    bench.ask(UseMap("flat", 1))
    job = bench.skill.handle(pack_body(UseMap("flat", 2)))
    assert isinstance(job, Generator)
    assert [step.done for step in islice(job, 3)] == [0.0, 1.0, 2.0]
    job.close()
    assert bench.skill.used == ("flat", 1)
    with pytest.raises(Refused, match="'meadow' cannot be used for localization"):
        bench.ask(UseMap("meadow", 1))
    assert bench.skill.used is None


def test_the_grids_of_the_map_before_are_gone_before_those_of_another_are_made() -> None:
    """Both at once may be more memory than the worker has; one whose making was given up is made again."""
    bench = Bench()
    bench.ask(UseMap("flat", 1))
    bench.drive(0, 10)
    job = bench.skill.handle(pack_body(UseMap("other", 1)))
    assert isinstance(job, Generator)
    assert next(job).text == "reading the map"
    with pytest.raises(Refused, match="no finished map is in use"):
        bench.ask(SetPose(0.0, 0.0, 0.0))
    assert bench.skill.report is None
    job.close()
    bench.ask(UseMap("flat", 1))
    assert bench.ask(SetPose(*(float(value) for value in TRUTH[0]))).state == "uncertain"


def test_a_pose_of_another_map_is_not_used() -> None:
    """It was kept for the office."""
    kept = SavedPose(
        map="office", version=1, x_m=1, y_m=1, heading_rad=0, covariance=(0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01)
    )
    assert Bench(Memory(kept)).ask(UseMap("flat", 1)).state == "unknown"


def test_a_pose_that_cannot_be_kept_is_told() -> None:
    """The disk is full: the robot drives on, and the reason is in the topic."""
    bench = Bench(Memory(refuses="the pose cannot be saved: no space left"))
    bench.ask(UseMap("flat", 1))
    bench.drive(0, 40)
    assert bench.told[-1].state == "localized"
    assert bench.told[-1].reason == "the pose cannot be saved: no space left"


def test_set_pose_and_localize_change_the_state_at_once() -> None:
    """Doubtful until scans confirm it; searching, whatever is known; and no map, nothing."""
    bench = Bench()
    bench.ask(UseMap("flat", 1))
    assert bench.ask(SetPose(*map(float, TRUTH[0]))).state == "uncertain"
    bench.drive(0, 6)
    assert bench.told[-1].state == "localized"
    assert bench.ask(Localize()).state == "searching"
    assert bench.ask(UseNone()) == bench.ask(UseNone())
    assert bench.ask(UseNone()).map is None


def test_a_lidar_that_is_turned_in_its_mount_is_said_and_no_pose_is_told_any_more() -> None:
    """It is found with the heading turned; when the robot has driven it is lost, until somebody has it look again."""
    bench = Bench()
    bench.ask(UseMap("flat", 1))
    bench.drive(0, 60, turned_rad=math.pi)
    assert "localized" in {told.state for told in bench.told}
    last = bench.told[-1]
    assert last.state == "lost"
    assert bench.poses[-1].stamp_s < last.stamp_s - 0.5, "no pose any more"
    assert "turned by about 180 degrees against its configured mounting" in last.reason
    assert bench.skill.problem == last.reason
    assert bench.ask(Localize()).reason == ""
    bench.told.clear()
    bench.drive(60, 90)
    assert {told.state for told in bench.told[-10:]} == {"localized"}
    assert bench.skill.problem == ""


def test_the_file_is_replaced_in_one_moment_and_damage_is_nothing(tmp_path: Path) -> None:
    """What was written is read again; half of it, nonsense and no file are all the same: no pose."""
    file = PoseOnDisk(tmp_path / "maps" / "last_pose.json")
    assert file.read() is None
    covariance = (0.04, 0.001, 0.0, 0.001, 0.02, 0.0, 0.0, 0.0, 0.003)
    pose = SavedPose(map="flat", version=3, x_m=1.25, y_m=-0.5, heading_rad=0.7, covariance=covariance)
    assert file.write(pose) == ""
    assert file.read() == pose
    assert [path.name for path in (tmp_path / "maps").iterdir()] == ["last_pose.json"]
    path = tmp_path / "maps" / "last_pose.json"
    whole = path.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"\xff\xfe", b"{}", whole.replace(b"0.02", b"-9.0")):
        path.write_bytes(damaged)
        assert file.read() is None


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    """A file lies where the folder should be."""
    (tmp_path / "maps").write_text("")
    covariance = (0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.01)
    pose = SavedPose(map="flat", version=1, x_m=0, y_m=0, heading_rad=0, covariance=covariance)
    assert PoseOnDisk(tmp_path / "maps" / "last_pose.json").write(pose).startswith("the pose cannot be saved")


def test_without_scans_it_is_not_sure_and_says_why() -> None:
    """The lidar is silent for 3 s while odometry goes on: uncertain, once a second; with the next scan sure again."""
    bench = Bench()
    bench.ask(UseMap("flat", 1))
    bench.drive(0, 40)
    assert bench.told[-1].state == "localized"
    bench.told.clear()
    bench.drive(40, 71, with_scans=False)
    assert [(told.state, told.reason) for told in bench.told] == [
        ("uncertain", "no scan of the lidar 'top' for 2 s"),
        ("uncertain", "no scan of the lidar 'top' for 3 s"),
    ]
    bench.drive(71, 76)
    assert (bench.told[-1].state, bench.told[-1].reason) == ("localized", "")


def test_where_the_lidar_never_speaks_the_search_says_so() -> None:
    """A map is in use, and no scan comes: otherwise it would be unknown for ever, and nobody told why."""
    bench = Bench()
    bench.ask(UseMap("flat", 1))
    bench.drive(0, 25, with_scans=False)
    assert (bench.told[-1].state, bench.told[-1].reason) == ("unknown", "no scan of the lidar 'top' for 2 s")


def test_a_pose_that_is_not_on_the_map_is_refused_and_what_is_known_stays() -> None:
    """It names the pose and how far the map reaches."""
    bench = Bench()
    bench.ask(UseMap("flat", 1))
    bench.drive(0, 40)
    with pytest.raises(
        Refused, match=r"\(1.00, -40.50\) is not on the map, which reaches from \("
    ) as refused:
        bench.ask(SetPose(1.0, -40.5, 0.3))
    assert refused.value.kind is RefusalKind.OUT_OF_RANGE
    bench.drive(40, 42)
    assert bench.told[-1].state == "localized"


def test_one_of_two_lidars_that_falls_silent_is_told_and_the_pose_stays_sure() -> None:
    """The leading one is silent for 4 s: the other finds the way, within 5 cm; back, nothing is told."""
    bench = Bench(lidars=("front", "rear"))
    bench.ask(UseMap("flat", 1))
    x, y, heading = map(float, TRUTH[1])
    bench.ask(SetPose(x, y, heading))
    bench.drive_by_two(1, 30)
    bench.told.clear()
    bench.drive_by_two(30, 70, silent="front")
    assert {one.state for one in bench.told} == {"localized"}
    assert bench.told[-1].reason == "no scan of the lidar 'front' for 3 s"
    assert off_m(bench, 69) < 0.05
    bench.drive_by_two(70, 75)
    assert (bench.told[-1].state, bench.told[-1].reason) == ("localized", "")
