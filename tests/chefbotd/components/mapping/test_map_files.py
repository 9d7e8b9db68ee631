"""What mapping begins with after a kill, a restart, a lost map or with a saved one; the disk is in memory."""

import pytest
from msgspec.structs import astuple

from chefbotd.components.mapping.skill_requests import (
    Discard,
    GetStatus,
    ResumeMapping,
    Start,
)
from chefbotd.components.maps.events import MapChanged
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.robot import MapPoseUpdated
from tests.chefbotd.components.worker.skills.mapping_bench import Bench, Memory


def test_a_map_that_begins_where_one_was_lost_says_so() -> None:
    """Both autosaves are damaged: said before, refused to whoever wants to go on, and in the answer of a new map."""
    bench = Bench(Memory(damage="version 8: slam.npz is missing; version 7: cells.zlib is damaged"))
    lost = "there was an unfinished map, and nothing of it can be read (version 8: slam.npz is missing; "
    before = bench.ask(GetStatus())
    assert (before.state, before.unfinished) == ("idle", False)
    assert before.warning.startswith(lost)
    with pytest.raises(Refused, match="nothing of it can be read") as refused:
        bench.ask(Start(unfinished=True))
    assert refused.value.kind is RefusalKind.MAP_UNREADABLE
    assert bench.ask(Start()).warning.startswith(lost)
    bench.memory.damage = ""  # it was pruned: two new autosaves are there
    bench.drive(0, 5)
    assert bench.ask(GetStatus()).warning.startswith(lost), "it is said as long as this map is made"
    assert bench.ask(Discard()).warning == ""


def test_an_older_state_that_is_gone_on_with_is_said() -> None:
    """The newest autosave is damaged and the one before it whole: mapping goes on from that, and says so."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 20)
    bench.skill.close()
    bench.memory.damage = "version 8: slam.npz is missing"
    again = Bench(bench.memory, session="two")
    told = again.ask(Start(unfinished=True))
    assert told.state == "mapping"
    assert told.warning is not None
    assert "version 8: slam.npz is missing" in told.warning
    assert "an older one is used" in told.warning


def test_a_worker_that_was_killed_goes_on_in_the_same_map() -> None:
    """The next one reads what was saved last; odometry has gone on, so it is not lost, and the poses go on."""
    first = Bench()
    first.ask(Start())
    first.drive(0, 130)
    kept = first.memory.autosaves
    assert kept == 2
    second = Bench(first.memory)
    assert second.ask(ResumeMapping(paused=False)).state == "mapping"
    second.drive(130, 150)
    poses = second.of(MapPoseUpdated)
    assert [pose.state for pose in poses].count("mapping") > 15  # type: ignore[attr-defined]
    last = astuple(poses[-1].map_from_base)  # type: ignore[attr-defined]
    first.drive(130, 150)
    assert last == pytest.approx(astuple(first.of(MapPoseUpdated)[-1].map_from_base), abs=0.05)  # type: ignore[attr-defined]
    assert second.of(MapChanged)[0].whole  # type: ignore[attr-defined]


def test_a_worker_that_was_killed_still_knows_which_map_it_goes_on_with() -> None:
    """So a pause ends by the same name."""
    first = Bench()
    first.ask(Start())
    first.drive(0, 30)
    first.finish("flat")
    first.ask(Start(name="flat"))
    first.told += first.skill.step(first.clock.now_s())
    second = Bench(first.memory)
    assert second.ask(ResumeMapping(paused=True, name="flat")).name == "flat"
    assert second.ask(GetStatus()).state == "paused"
    assert second.ask(Start(name="flat")).state == "mapping"


def test_nothing_kept_is_said() -> None:
    """A worker that is to go on, and finds nothing, is idle and says so."""
    status = Bench().ask(ResumeMapping(paused=True))
    assert (status.state, "nothing was kept" in status.reason) == ("idle", True)


def test_after_the_daemons_restart_the_map_waits_for_a_word() -> None:
    """The unfinished map is not overwritten by a new one; gone on with, the robot is lost until it knows a place."""
    first = Bench()
    first.ask(Start())
    first.drive(0, 120)
    first.skill.close()
    second = Bench(first.memory, session="two")
    with pytest.raises(Refused, match="unfinished map") as refused:
        second.ask(Start())
    assert refused.value.kind is RefusalKind.ALREADY_MAPPING
    status = second.ask(Start(unfinished=True))
    assert status.keyframes > 30
    second.drive(100, 105)
    assert {pose.state for pose in second.of(MapPoseUpdated)} <= {"lost", "searching"}  # type: ignore[attr-defined]
    assert second.ask(Discard()).state == "idle"
    assert second.ask(Start()).state == "mapping"


def test_a_saved_map_is_gone_on_with_by_its_name() -> None:
    """It has all of its scans; one that was not made by SLAM is refused in words."""
    bench = Bench()
    bench.ask(Start())
    bench.drive(0, 60)
    saved, _ = bench.finish("flat")
    status = bench.ask(Start(name="flat"))
    assert (status.name, status.keyframes) == ("flat", saved.keyframes)
    bench.ask(Discard())
    bench.memory.read_slam = lambda name: None  # type: ignore[method-assign]
    with pytest.raises(Refused, match="was not made by mapping"):
        bench.ask(Start(name="flat"))
