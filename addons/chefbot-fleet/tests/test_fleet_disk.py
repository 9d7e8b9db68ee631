"""Each write of the manager fails once, or is its last: orders are done, and traffic is as the disk has it."""

import sqlite3
from pathlib import Path

import pytest
from chefbot_fleet.store import Stage, Store
from chefbot_vda5050.messages import ConnectionState
from fleet_world import World, small_roadmap, steps

MOST_WRITES = 200
FAILURES = ("database or disk is full", "disk I/O error", "killed")


class Killed(Exception):
    """The manager's process ended in the middle of a write."""


class Disk(Store):
    """Its write of this number, counted from 0, fails, and so do a few after it; ``killed``: that is its end."""

    number, lasts, how = 0, 1, ""

    def _write(self, *words: object) -> None:
        Disk.number -= 1
        if -Disk.lasts <= Disk.number < 0:
            if Disk.how == "killed":
                raise Killed
            self._database.execute("BEGIN IMMEDIATE")  # the transaction within it fails
        try:
            super()._write(*words)  # type: ignore[arg-type]
        finally:
            if self._database.in_transaction:
                self._database.rollback()


def world_on(path: Path, monkeypatch: pytest.MonkeyPatch, number: int, how: str, lasts: int) -> World:
    """Two robots and two orders, with this write failing."""
    monkeypatch.setattr("fleet_world.Store", Disk)
    monkeypatch.setattr(Disk, "number", number)
    monkeypatch.setattr(Disk, "how", how)
    monkeypatch.setattr(Disk, "lasts", lasts)
    return World(small_roadmap(), path, robots=2)


def check(world: World) -> None:
    """What traffic has released is what each robot's order has; and no node is released to two at once."""
    if world.fleet._failures != world.fleet.store.failures:
        return  # it is made again before anything else
    for name, vehicle in world.fleet.vehicles.items():
        robot = world.fleet.traffic.robots[name]
        released = [move.target for move in robot.moves[: robot.released]]
        assert (robot.node, released) == (vehicle.node, vehicle.base), name


def step(world: World) -> None:
    """Half a second; a manager that was killed begins again."""
    try:
        world.step()
    except Killed:
        world.kill_manager()
    check(world)


def give(world: World, name: str, pick: str, drop: str) -> None:
    """A person gives an order until it is taken."""
    while name not in world.fleet.orders:
        try:
            world.fleet.add_order(name, pick, drop, world.now_s)
        except Killed:
            world.kill_manager()
        except sqlite3.Error:
            step(world)


@pytest.mark.parametrize(
    "every", [pytest.param(1, marks=pytest.mark.slow), 7], ids=["each write", "every seventh"]
)
@pytest.mark.parametrize("lasts", [1, 5])
@pytest.mark.parametrize("how", FAILURES)
def test_whichever_write_fails_every_order_is_done_once(
    how: str, lasts: int, every: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two orders by two robots; traffic never has more or less than the robots' orders on the disk."""
    for number in range(0, MOST_WRITES, every):
        world = world_on(tmp_path / f"{number}.db", monkeypatch, number, how, 1 if how == "killed" else lasts)
        step(world)
        give(world, "a", "counter", "table")
        give(world, "b", "table", "counter")
        while world.now_s < 300.0 and any(o.stage is not Stage.DONE for o in world.fleet.orders.values()):
            step(world)
        assert world.work() == ["a-0", "a-1", "b-0", "b-1"], number
        assert (world.done_by_two(), world.repeated()) == (0, 0), number
        world.store.close()
        if Disk.number >= 0:
            assert number > 20
            return
    raise AssertionError(f"more than {MOST_WRITES} writes")


@pytest.mark.parametrize("how", FAILURES)
def test_whichever_write_fails_a_cancelled_order_ends_and_stays_so(
    how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """People cancel it until that is taken; the robot ends it, and drives home."""
    for number in range(MOST_WRITES):
        world = world_on(tmp_path / f"{number}.db", monkeypatch, number, how, 1)
        step(world)
        give(world, "a", "counter", "table")
        while world.now_s < 4.0:
            step(world)
        while world.fleet.orders["a"].stage not in (Stage.CANCELLING, Stage.CANCELLED):
            try:
                world.fleet.cancel_order("a")
            except Killed:
                world.kill_manager()
            except sqlite3.Error:
                step(world)
        while world.now_s < 60.0:
            step(world)
        assert world.fleet.orders["a"].stage is Stage.CANCELLED, number
        assert [v.cancel_id for v in world.fleet.vehicles.values()] == [None, None], number
        world.store.close()
        if Disk.number >= 0:
            return
    raise AssertionError(f"more than {MOST_WRITES} writes")


@pytest.mark.parametrize("number", range(3))
def test_a_removed_robots_order_is_not_given_to_two_where_the_removal_is_not_written(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is removed again once there is room; the other robot does the order, once."""
    world = world_on(tmp_path / "fleet.db", monkeypatch, 1000, "disk I/O error", 1)
    step(world)
    give(world, "a", "counter", "table")
    step(world)
    (name,) = (vehicle.name for vehicle in world.fleet.vehicles.values() if vehicle.task)
    world.robots.pop(name)
    world.fleet.on_connection(name, ConnectionState.BROKEN, world.now_s)
    Disk.number = number
    while name in world.fleet.vehicles:
        try:
            world.fleet.remove_robot(name, world.now_s)
        except sqlite3.Error:
            steps(world, 5.0)
    Disk.number = 1000
    steps(world, 100.0)
    assert world.fleet.orders["a"].stage is Stage.DONE
    assert world.work() == ["a-0", "a-1"]
