"""What the manager keeps over its own death: orders, robots with what was sent to them, corrections of the roadmap.

SQLite in WAL mode; every change is on the disk before anything that follows from it is sent.
"""

import sqlite3
from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import Struct

SCHEMA = """
CREATE TABLE IF NOT EXISTS orders (identifier TEXT PRIMARY KEY, value BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS robots (name TEXT PRIMARY KEY, value BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS corrections (number INTEGER PRIMARY KEY, value BLOB NOT NULL);
"""


class Stage(StrEnum):
    """How far an order is."""

    WAITING = "waiting"
    ASSIGNED = "assigned"
    PICKED = "picked"
    CANCELLING = "cancelling"
    CANCELLED = "cancelled"
    DONE = "done"
    FAILED = "failed"


class FleetOrder(Struct):
    """Something to fetch at one place and to bring to another; ``since_s`` is seconds since 1970."""

    identifier: str
    pick: str
    drop: str
    since_s: float
    stage: Stage = Stage.WAITING
    robot: str | None = None
    why: str | None = None


class Vehicle(Struct):
    """A robot as the manager knows it: the order that it was sent, and the nodes of it that it has still to reach.

    ``sequence`` is the sequenceId of ``node``, which it reached last; those of ``base`` follow in steps of two.
    ``series`` tells its orders from those of an earlier time in the fleet.
    ``has_work``: it has reported the order of the work ``action_id``.
    ``cancel_id`` is the ``cancelOrder`` that it has not answered yet.
    """

    name: str
    home: int
    node: int
    order_id: str = ""
    update_id: int = 0
    sequence: int = 0
    base: list[int] = []
    trips: int = 0
    task: str | None = None
    stops_done: int = 0
    action_id: str | None = None
    has_work: bool = False
    series: str = "0"
    cancel_id: str | None = None


class Correction(Struct):
    """A change of the roadmap by hand, in nodes: an edge more or less, or a passing place beside a node."""

    kind: str
    a: int
    b: int = -1
    x_m: float = 0.0
    y_m: float = 0.0


T = TypeVar("T", bound=Struct)


class Store:
    """The database, which one manager has at a time, until it closes it or dies.

    What cannot be written is not so in memory either: a failed ``save`` gives its values the fields back that are on the
    disk. So asked for again, the same change is written again. ``failures`` counts the writes that failed: what else
    follows from them in memory is to be made again from what is on the disk.

    Raises ``sqlite3.Error`` if it cannot be read or written, or another manager has it.
    """

    def __init__(self, path: Path | str) -> None:
        self.failures = 0
        self._database = sqlite3.connect(path, timeout=0.0, isolation_level=None)
        self._database.execute("PRAGMA locking_mode=EXCLUSIVE")
        self._database.execute("PRAGMA journal_mode=WAL")
        self._database.execute("PRAGMA synchronous=FULL")
        self._database.executescript(SCHEMA)
        self._written: dict[tuple[type[Struct], str], bytes] = {}

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def save(self, *values: FleetOrder | Vehicle) -> None:
        """Write these at once or not at all."""
        self._write(values)

    def forget(self, vehicle: Vehicle, *values: FleetOrder) -> None:
        """Remove a robot, and write these, at once or not at all."""
        self._write(values, ("DELETE FROM robots WHERE name = ?", (vehicle.name,)))
        self._written.pop(_key(vehicle), None)

    def correct(self, correction: Correction) -> None:
        """Add a correction of the roadmap."""
        data = msgspec.json.encode(correction)
        self._write((), ("INSERT INTO corrections (value) VALUES (?)", (data,)))

    def _write(
        self, values: Iterable[FleetOrder | Vehicle], *changes: tuple[str, tuple[str | bytes, ...]]
    ) -> None:
        encoded = {_key(value): msgspec.json.encode(value) for value in values}
        try:
            with self._database:
                self._database.execute("BEGIN")
                for (kind, name), data in encoded.items():
                    table = "orders" if kind is FleetOrder else "robots"
                    self._database.execute(f"REPLACE INTO {table} VALUES (?, ?)", (name, data))  # noqa: S608 - ours
                for statement, parameters in changes:
                    self._database.execute(statement, parameters)
        except sqlite3.Error:
            self.failures += 1
            for value in values:
                self._take_back(value)
            raise
        self._written |= encoded

    def _take_back(self, value: FleetOrder | Vehicle) -> None:
        """Make a value again what is on the disk; one that was never there stays as it is."""
        data = self._written.get(_key(value))
        if data is not None:
            before = msgspec.json.decode(data, type=type(value))
            for name in value.__struct_fields__:
                setattr(value, name, getattr(before, name))

    def orders(self) -> dict[str, FleetOrder]:
        """All orders, the oldest first."""
        orders = self._all("SELECT value FROM orders", FleetOrder)
        self._written |= {_key(order): msgspec.json.encode(order) for order in orders}
        return {order.identifier: order for order in sorted(orders, key=lambda order: order.since_s)}

    def vehicles(self) -> list[Vehicle]:
        """All robots."""
        vehicles = self._all("SELECT value FROM robots ORDER BY name", Vehicle)
        self._written |= {_key(vehicle): msgspec.json.encode(vehicle) for vehicle in vehicles}
        return vehicles

    def corrections(self) -> list[Correction]:
        """All corrections, in the order in which they were made."""
        return self._all("SELECT value FROM corrections ORDER BY number", Correction)

    def _all(self, query: str, kind: type[T]) -> list[T]:
        rows: list[tuple[Any]] = self._database.execute(query).fetchall()
        return [msgspec.json.decode(value, type=kind) for (value,) in rows]


def _key(value: FleetOrder | Vehicle) -> tuple[type[Struct], str]:
    return type(value), value.identifier if isinstance(value, FleetOrder) else value.name
