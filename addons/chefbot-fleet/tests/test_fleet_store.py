"""The manager's database: what is on the disk is what is in memory, whatever write fails."""

import sqlite3
from pathlib import Path
from typing import Any

import msgspec
import pytest
from chefbot_fleet.store import FleetOrder, Stage, Store, Vehicle


class FailingDisk:
    """A database whose statement of this number, counted from 0, fails; 3 is the end of the transaction."""

    def __init__(self, database: sqlite3.Connection, fails_at: int) -> None:
        self._database, self._left = database, fails_at

    def execute(self, *words: Any) -> Any:
        """Run it, or fail."""
        self._left -= 1
        if self._left < 0:
            raise sqlite3.OperationalError("database or disk is full")
        return self._database.execute(*words)

    def __enter__(self) -> None:
        self._database.__enter__()

    def __exit__(self, kind: Any, *words: Any) -> None:
        if kind is None and self._left <= 0:
            self._database.rollback()
            raise sqlite3.OperationalError("disk I/O error")
        self._database.__exit__(kind, *words)


@pytest.mark.parametrize("fails_at", [0, 1, 2, 3])
@pytest.mark.parametrize("is_new_manager", [False, True])
def test_a_cancelled_order_does_not_come_back_where_its_write_failed(
    tmp_path: Path, fails_at: int, is_new_manager: bool
) -> None:
    """At each write: order and robot are as before in memory; the repeat writes, and the next manager has it."""
    path = tmp_path / "fleet.sqlite"
    store = Store(path)
    order, vehicle = (
        FleetOrder("a", "bar", "table", 1.0, Stage.ASSIGNED, "r1"),
        Vehicle("r1", 0, 0, base=[1, 2]),
    )
    store.save(order, vehicle)
    if is_new_manager:
        store.close()
        store = Store(path)
        order, vehicle = store.orders()["a"], store.vehicles()[0]
    before = msgspec.json.encode((order, vehicle))

    def cancel() -> None:
        order.stage, vehicle.cancel_id = Stage.CANCELLING, "cancel-1"
        vehicle.base.pop(0)
        store.save(order, vehicle)

    database = store._database
    store._database = FailingDisk(database, fails_at)  # type: ignore[assignment]
    with pytest.raises(sqlite3.Error):
        cancel()
    assert msgspec.json.encode((order, vehicle)) == before
    store._database = database
    cancel()
    store.close()
    again = Store(path)
    assert again.orders()["a"].stage is Stage.CANCELLING
    assert (again.vehicles()[0].cancel_id, again.vehicles()[0].base) == ("cancel-1", [2])
    again.close()
