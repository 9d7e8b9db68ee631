"""The waiter's orders in a small file, which outlives the program."""

import os
from pathlib import Path
from typing import Final

import msgspec

OPEN: Final = ("waiting", "driving", "arrived")


class Order(msgspec.Struct):
    """``state`` is ``waiting``, ``driving``, ``arrived``, ``served`` or ``refused``, the last with its ``reason``.

    ``stop_number`` is that of the topic safety when a person last wanted it.
    """

    number: int
    table: str
    state: str = "waiting"
    reason: str = ""
    tries: int = 1
    stop_number: int | None = None


class Page(msgspec.Struct):
    """What is in the file. ``name`` is no other notebook's, and ``ways_home`` counts the goals at home.

    ``stop_number`` is that of the topic safety when a person last wanted anything.

    ``is_stopped``: somebody stopped the robot, and nobody has agreed yet that it goes on.
    """

    name: str
    orders: list[Order] = []
    ways_home: int = 0
    is_stopped: bool = False
    stop_number: int | None = None


class Notebook:
    """``page`` is what it holds; each change is on the disk when ``save`` returns."""

    def __init__(self, path: Path) -> None:
        self._path = path
        written = path.read_bytes() if path.exists() else None
        self.page = Page(os.urandom(4).hex()) if written is None else msgspec.json.decode(written, type=Page)
        if written is None:
            self.save()  # its name is part of the goals' ids

    def save(self) -> None:
        """Replace the file at once: whoever is killed meanwhile leaves the old one."""
        new = self._path.with_suffix(".new")
        new.write_bytes(msgspec.json.format(msgspec.json.encode(self.page)))
        new.replace(self._path)

    def take(self, table: str, stop_number: int | None = None) -> Order | None:
        """A new order of a table; None: it waits for one already."""
        if any(order.table == table and order.state in OPEN for order in self.page.orders):
            return None
        order = Order(len(self.page.orders) + 1, table, stop_number=stop_number)
        self.page.stop_number = stop_number
        self.page.orders.append(order)
        self.save()
        return order

    def next(self) -> Order | None:
        """The oldest order that is open."""
        return next((order for order in self.page.orders if order.state in OPEN), None)

    def note_stopped(self, *, is_stopped: bool) -> None:
        """Somebody has stopped the robot, or agrees that it goes on."""
        self.page.is_stopped = is_stopped
        self.save()

    def note_agreed(self, stop_number: int) -> None:
        """Somebody agrees that it goes on with all that is open."""
        self.page.stop_number = stop_number
        for order in self.page.orders:
            order.stop_number = stop_number if order.state in OPEN else order.stop_number
        self.note_stopped(is_stopped=False)

    def note_way_home(self, *, is_stopped: bool) -> None:
        """The goal at home has ended; the next one has another number."""
        self.page.ways_home += 1
        self.note_stopped(is_stopped=is_stopped)

    def note(self, order: Order, state: str, reason: str = "") -> None:
        """What became of an order."""
        order.state, order.reason = state, reason
        self.save()
