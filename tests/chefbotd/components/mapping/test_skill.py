"""The skill that makes maps, by what it is given and asked, and what it tells; the disk is in memory."""

import math
import re
import zlib

import numpy as np
import pytest
from msgspec.structs import astuple

from chefbotd.components.mapping.algorithms.saved import restore_state
from chefbotd.components.mapping.skill_requests import (
    Discard,
    Finish,
    GetGrid,
    GetStatus,
    MappingRequest,
    PauseMapping,
    Start,
)
from chefbotd.components.maps.events import MapChanged, MappingChanged
from chefbotd.components.worker.messages import pack_body
from chefbotd.components.worker.skill import Struct
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import MapPoseUpdated, OdometryUpdated
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.core.poses import Floats, transform
from chefbotd.core.record import replace
from tests.chefbotd.components.mapping.algorithms.slam.flat import furnished_flat, to_walls_m
from tests.chefbotd.components.worker.skills.drives import MOUNT, TRUTH, measured, measured_by_two, turn
from tests.chefbotd.components.worker.skills.mapping_bench import SCANS, Bench


@pytest.fixture(scope="module")
def driven() -> Bench:
    """A map that is being made; tests of this one only look."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, SCANS)
    return bench


def test_every_scan_gives_a_pose_near_the_truth(driven: Bench) -> None:
    """Odometry is off by a decimetre or more by then; the map's pose is within 3 cm, in the frame of the first scan."""
    poses = driven.of(MapPoseUpdated)
    assert len(poses) == SCANS
    found = np.array([astuple(pose.map_from_base) for pose in poses])  # type: ignore[attr-defined]
    first, there = TRUTH[0], TRUTH[:SCANS]
    cos, sin = np.cos(first[2]), np.sin(first[2])
    dx, dy = there[:, 0] - first[0], there[:, 1] - first[1]
    off_m = np.hypot(cos * dx + sin * dy - found[:, 0], cos * dy - sin * dx - found[:, 1])
    assert off_m.max() < 0.03
    odometry = np.array([astuple(each.map_from_odom.inverse().compose(each.map_from_base)) for each in poses])  # type: ignore[attr-defined]
    assert np.hypot(cos * dx + sin * dy - odometry[:, 0], cos * dy - sin * dx - odometry[:, 1]).max() > 0.1


def test_patches_put_together_are_the_map(driven: Bench) -> None:
    """A client that applies each patch has what get_grid tells; revisions follow each other without a gap."""
    cells, revisions = np.zeros((0, 0), np.int8), []
    for part in driven.of(MapChanged):
        assert isinstance(part, MapChanged)
        inside = np.frombuffer(zlib.decompress(part.cells), np.int8).reshape(
            part.part_rows, part.part_columns
        )
        if part.whole:
            cells = inside.copy()
        cells[part.row : part.row + part.part_rows, part.column : part.column + part.part_columns] = inside
        assert cells.shape == (part.rows, part.columns)
        revisions.append(part.revision)
    assert revisions == list(range(1, len(revisions) + 1))
    assert len(revisions) >= SCANS * 0.1 * 0.5
    whole = driven.skill.handle(pack_body(GetGrid()))
    assert isinstance(whole, MapChanged)
    assert np.array_equal(np.frombuffer(zlib.decompress(whole.cells), np.int8), cells.ravel())


def test_it_is_told_and_saved_now_and_then(driven: Bench) -> None:
    """Told once a second and saved at once and every ten: 13 s of driving."""
    assert 10 <= len(driven.of(MappingChanged)) <= 15
    assert driven.memory.autosaves == 2
    last = driven.of(MappingChanged)[-1]
    assert isinstance(last, MappingChanged)
    assert (last.state, last.name, last.reason) == ("mapping", None, "")
    assert last.keyframes > 30


def walls_off_m(grid: OccupancyGrid) -> Floats:
    """How far each occupied cell is from the nearest true wall; the map begins where the tour does."""
    rows, columns = np.nonzero(grid.percent >= 65)
    origin = np.array([grid.map_from_grid.x_m, grid.map_from_grid.y_m])
    cells = (np.column_stack([columns, rows]) + 0.5) * grid.resolution_m + origin
    return to_walls_m(furnished_flat(), transform(TRUTH[1], cells))


@pytest.mark.slow
def test_two_lidars_that_are_blind_behind_make_one_map() -> None:
    """Front and rear, half a step apart in time: walls within 3 cm (median) and 6 cm (p95) of the true ones."""
    bench = Bench(lidars=("front", "rear"))
    bench.ask(Start())
    bench.drive(0, 0, measured_by_two(0, 260))
    bench.finish("flat")
    grid, slam = bench.memory.maps["flat"][0]
    off_m = walls_off_m(grid)
    assert (np.median(off_m) < 0.03, np.quantile(off_m, 0.95) < 0.06) == (True, True)
    kept = restore_state(slam).nodes.scans
    assert all(len(np.unique(scan.sensor_m, axis=0)) == 2 for scan in kept[1:])
    assert all(scan.sensor_m.shape == scan.points.shape for scan in kept[1:])


def test_one_of_two_lidars_that_falls_silent_is_told_and_the_map_goes_on() -> None:
    """First the leading one for 4 s, then the other: each is named, poses go on within 5 cm; back, nothing is told."""
    bench = Bench(lidars=("front", "rear"))
    bench.ask(Start())
    for silent, first, last in (("", 0, 30), ("front", 30, 70), ("rear", 70, 110), ("", 110, 120)):
        seen = [
            m for m in measured_by_two(first, last) if not (isinstance(m, ScanMeasured) and m.lidar == silent)
        ]
        bench.drive(0, 0, seen)
        status = bench.ask(GetStatus())
        assert status.state == "mapping"
        assert re.sub(r"\d+ s$", "N s", status.reason) == (
            f"no scan of the lidar {silent!r} for N s" if silent else ""
        )
    poses = [each for each in bench.of(MapPoseUpdated) if isinstance(each, MapPoseUpdated)]
    assert np.diff([pose.stamp_s for pose in poses]).max() < 0.7
    last_pose = transform(TRUTH[1], np.array([astuple(poses[-1].map_from_base)[:2]]))[0]
    assert np.hypot(*(last_pose - TRUTH[119][:2])) < 0.05


def test_another_lidars_scans_are_not_mapped() -> None:
    """The map is of those that are named."""
    bench = Bench()
    bench.ask(Start())
    others = [replace(m, lidar="low") if isinstance(m, ScanMeasured) else m for m in measured(0, 5)]
    bench.drive(0, 5, others)
    assert not bench.of(MapPoseUpdated)


def test_a_scan_waits_for_odometry_but_not_for_ever() -> None:
    """It is placed once odometry of its time is there; without that, after a quarter of a second, by the last."""
    bench = Bench()
    bench.ask(Start())
    messages = list(measured(0, 3))
    bench.drive(0, 0, messages[:5])  # odometry, scan, odometry; odometry, scan
    assert len(bench.of(MapPoseUpdated)) == 1
    bench.clock.advance(0.3)
    bench.told += bench.skill.step(bench.clock.now_s())
    assert len(bench.of(MapPoseUpdated)) == 2


@pytest.mark.parametrize("broken", ["nan_stamp", "nan_ranges", "far"])
def test_a_broken_scan_is_let_go(broken: str) -> None:
    """A time that is none, readings that are none: the map goes on with the next scan."""
    bench = Bench()
    bench.ask(Start())
    messages = list(measured(0, 6))
    scan = messages[7]
    assert isinstance(scan, ScanMeasured)
    nonsense = {"nan_ranges": np.nan, "far": 1e30}.get(broken, 1.0)
    ranges = np.full(len(scan.scan.range_m), nonsense)
    stamp_s = float("nan") if broken == "nan_stamp" else scan.stamp_s
    messages[7] = turn(stamp_s, "top", scan.base_from_lidar, scan.scan.bearing_rad, ranges)
    bench.drive(0, 0, messages)
    assert bench.of(MapPoseUpdated)[-1].stamp_s == pytest.approx(50.5)  # type: ignore[attr-defined]


def test_a_finished_map_is_saved_with_all_to_go_on_from() -> None:
    """It says how far it is up to the end, saves the refined map, and forgets what it saved on its own."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 60)
    saved, progress = bench.finish("flat")
    assert (saved.name, saved.version) == ("flat", 1)
    shares = [done.done / done.total for done in progress]
    assert shares == sorted(shares)
    assert [done.text for done in progress[-2:]] == ["drawing the map", "saving the map"]
    assert bench.memory.kept is None
    assert len(restore_state(bench.memory.maps["flat"][0][1]).nodes) == saved.keyframes
    with pytest.raises(Refused) as refused:
        bench.ask(PauseMapping())
    assert refused.value.kind is RefusalKind.NOT_MAPPING


def test_a_finish_that_is_given_up_changes_nothing() -> None:
    """Cancelled in the middle, or refused by the disk: the map is being made as before, and is not saved."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 40)
    job = bench.skill.handle(pack_body(Finish("flat")))
    assert not isinstance(job, Struct)
    next(job)
    job.close()
    assert not bench.memory.maps
    bench.drive(40, 45)
    assert bench.of(MapPoseUpdated)[-1].fit > 0.9  # type: ignore[attr-defined]
    bench.memory.full = True
    with pytest.raises(Refused, match="the disk is full"):
        bench.finish("flat")
    bench.memory.full = False
    assert bench.finish("flat")[0].version == 1


@pytest.mark.parametrize("other", [Finish("other"), Discard(), PauseMapping(), Start()])
def test_nothing_else_is_done_to_a_map_that_is_being_finished(other: MappingRequest) -> None:
    """Also where it is asked at the same instant, before the first step: the map is saved as it was."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 30)
    job = bench.skill.handle(pack_body(Finish("flat")))
    assert not isinstance(job, Struct)
    with pytest.raises(Refused, match=r"being finished|it is finishing"):
        bench.skill.handle(pack_body(other))
    assert list(job)
    assert list(bench.memory.maps) == ["flat"]


def test_a_finish_that_is_cancelled_before_its_first_step_changes_nothing() -> None:
    """It can be asked for again at once."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 30)
    job = bench.skill.handle(pack_body(Finish("flat")))
    assert not isinstance(job, Struct)
    job.close()
    assert bench.finish("flat")[0].version == 1


def test_a_name_that_cannot_be_is_refused_before_the_work() -> None:
    """And not after all scans were matched; a name is kept in Unicode's form NFC, and told so."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 30)
    with pytest.raises(Refused, match=r"'\.\./x' cannot be a map's name") as refused:
        bench.skill.handle(pack_body(Finish("../x")))
    assert refused.value.kind is RefusalKind.BAD_NAME
    assert bench.finish("Ku\u0308che")[0].name == "K\u00fcche"


def test_the_way_between_two_parts_is_none() -> None:
    """Gone on with by the next daemon, the robot may be anywhere: from the last scan to the first new one is no way."""
    first = Bench()
    first.ask(Start())
    first.drive(0, 60)
    way_m = first.finish("flat")[0].path_m
    second = Bench(first.memory, session="two")
    second.ask(Start(name="flat"))
    second.drive(110, 111)
    status = second.ask(GetStatus())
    assert status.path_m == pytest.approx(way_m)


def test_an_autosave_that_cannot_be_removed_is_said_and_the_map_is_saved() -> None:
    """The next map can be begun once it is gone."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 30)
    bench.memory.stubborn = True
    assert bench.finish("flat")[0].version == 1
    with pytest.raises(Refused, match="Permission denied"):
        bench.ask(Discard())
    with pytest.raises(Refused, match="unfinished map"):
        bench.ask(Start())
    bench.memory.stubborn = False
    assert bench.ask(Discard()).state == "idle"
    assert bench.ask(Start()).state == "mapping"


def test_a_full_disk_is_said_and_mapping_goes_on() -> None:
    """The status has the reason until a save succeeds."""
    bench = Bench()
    bench.memory.full = True
    bench.ask(Start())
    bench.drive(0, 30)
    reasons = [status.reason for status in bench.of(MappingChanged)]  # type: ignore[attr-defined]
    assert "cannot save: the disk is full" in reasons
    bench.memory.full = False
    bench.drive(30, 150)
    assert bench.of(MappingChanged)[-1].reason == ""  # type: ignore[attr-defined]
    assert bench.memory.kept is not None


def test_a_lidar_that_falls_silent_in_mid_mapping_is_said_with_the_seconds() -> None:
    """From 2 s on, each second anew; the odometry goes on meanwhile, and with the next scan nothing is missing."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 5)
    bench.told.clear()
    bench.drive(5, 38, [each for each in measured(5, 38) if isinstance(each, OdometryUpdated)])
    told = [each.reason for each in bench.of(MappingChanged) if each.reason]  # type: ignore[attr-defined]
    assert told == ["no scan of the lidar 'top' for 2 s", "no scan of the lidar 'top' for 3 s"]
    bench.drive(38, 40)
    assert bench.ask(GetStatus()).reason == ""


def test_a_lidar_that_is_turned_in_its_mount_is_said_while_the_map_is_made() -> None:
    """The configuration is off by half a turn: the map comes out well, and whoever makes it is told what is wrong."""
    bench = Bench()
    bench.ask(Start())
    turned = [
        replace(each, base_from_lidar=replace(MOUNT, heading_rad=MOUNT.heading_rad - math.pi))
        if isinstance(each, ScanMeasured)
        else each
        for each in measured(0, 40)
    ]
    bench.drive(0, 40, turned)
    told = re.search(r"turned by about (-?\d+) degrees against its conf", bench.ask(GetStatus()).reason)
    assert told is not None
    assert abs(math.remainder(int(told[1]) - 180, 360)) < 15, "odometry has its error"
    assert bench.ask(Discard()).reason == ""


def test_odometry_that_falls_silent_in_mid_mapping_is_said() -> None:
    """Scans go on to come; nothing is missing while mapping is paused."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 5)
    begun_s = bench.clock.now_s()
    for scan in (each for each in measured(5, 32) if isinstance(each, ScanMeasured)):
        bench.clock.advance(scan.stamp_s - bench.clock.now_s())
        list(bench.skill.take_scan(scan))
        list(bench.skill.step(bench.clock.now_s()))
    assert 2.6 < bench.clock.now_s() - begun_s < 2.8
    assert bench.ask(GetStatus()).reason == "no odometry for 2 s"
    bench.ask(PauseMapping())
    list(bench.skill.step(bench.clock.now_s()))
    assert bench.ask(GetStatus()).reason == ""


def test_a_lidar_from_which_nothing_ever_came_is_said_too() -> None:
    """The seconds count from the beginning of the map; what the worker was too busy to look at counts for nobody."""
    bench = Bench()
    bench.ask(Start())
    for _ in range(5):
        list(bench.skill.step(bench.clock.now_s()))
        bench.clock.advance(0.5)
    list(bench.skill.step(bench.clock.now_s()))
    assert bench.ask(GetStatus()).reason == "no scan of the lidar 'top' for 2 s; no odometry for 2 s"
    bench.clock.advance(7.0)
    list(bench.skill.step(bench.clock.now_s()))
    assert bench.ask(GetStatus()).reason == ""


def test_a_pause_adds_nothing() -> None:
    """Scans that come meanwhile are let go; start_mapping goes on."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 20)
    kept = bench.ask(PauseMapping()).keyframes
    bench.drive(20, 40)
    assert len(bench.of(MapPoseUpdated)) == 20
    status = bench.ask(Start())
    assert (status.state, status.keyframes) == ("mapping", kept)


@pytest.mark.parametrize(
    ("request_", "kind"),
    [
        (PauseMapping(), RefusalKind.NOT_MAPPING),
        (Finish("flat"), RefusalKind.NOT_MAPPING),
        (GetGrid(), RefusalKind.NOT_MAPPING),
        (Start(unfinished=True), RefusalKind.NOT_MAPPING),
    ],
)
def test_without_a_map_there_is_nothing_to_do(request_: MappingRequest, kind: RefusalKind) -> None:
    """Each is refused with its kind."""
    with pytest.raises(Refused) as refused:
        Bench().skill.handle(pack_body(request_))
    assert refused.value.kind is kind


def test_a_second_map_at_once_is_refused() -> None:
    """The first one has to be finished or discarded; an empty one is nothing to finish."""
    bench = Bench()
    bench.ask(Start())
    with pytest.raises(Refused, match="being made already") as refused:
        bench.ask(Start(name="flat"))
    assert refused.value.kind is RefusalKind.ALREADY_MAPPING
    with pytest.raises(Refused, match="no scan has arrived yet"):
        bench.skill.handle(pack_body(Finish("flat")))


def test_the_end_of_the_daemon_saves_what_there_is() -> None:
    """What was mapped since the last save is not lost."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 80)
    bench.skill.close()
    assert bench.memory.kept is not None
    kept = len(restore_state(bench.memory.kept[1]).nodes)
    assert kept == bench.of(MappingChanged)[-1].keyframes or kept > 20  # type: ignore[attr-defined]
