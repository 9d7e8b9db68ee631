"""The waiter's orders in a small file, which outlives the program."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec.structs import replace

from chefbotd.storage import explain, replace_file

OPEN: Final = ("waiting", "driving", "arrived")


class CannotNote(Exception):
    """The file could not be written, so nothing has changed; the message says why."""


class Order(msgspec.Struct, frozen=True):
    """``state`` is ``waiting``, ``driving``, ``arrived``, ``served`` or ``refused``, the last with its ``reason``.

    ``stop_number`` is that of the topic safety when a person last wanted it.
    """

    number: int
    table: str
    state: str = "waiting"
    reason: str = ""
    tries: int = 1
    stop_number: int | None = None


class Page(msgspec.Struct, frozen=True):
    """What is in the file. ``name`` is no other notebook's, and ``ways_home`` counts the goals at home.

    ``stop_number`` is that of the topic safety when a person last wanted anything.

    ``is_stopped``: somebody stopped the robot, and nobody has agreed yet that it goes on.
    """

    name: str
    orders: tuple[Order, ...] = ()
    ways_home: int = 0
    is_stopped: bool = False
    stop_number: int | None = None


class Notebook:
    """``page`` is what is on the disk: a change that cannot be written raises ``CannotNote``, and is not made."""

    def __init__(self, path: Path, write: Callable[[Path, bytes], None] = replace_file) -> None:
        self._path, self._write = path, write
        if path.exists():
            self.page = msgspec.json.decode(path.read_bytes(), type=Page)
        else:
            self._change(Page(os.urandom(4).hex()))  # its name is part of the goals' ids

    def _change(self, page: Page) -> None:
        try:
            self._write(self._path, msgspec.json.format(msgspec.json.encode(page)))
        except OSError as error:
            raise CannotNote(f"I cannot write to my notebook: {explain(error)}") from error
        self.page = page

    def take(self, table: str, stop_number: int | None = None) -> Order | None:
        """A new order of a table; None: it waits for one already."""
        if any(order.table == table and order.state in OPEN for order in self.page.orders):
            return None
        order = Order(len(self.page.orders) + 1, table, stop_number=stop_number)
        self._change(replace(self.page, stop_number=stop_number, orders=(*self.page.orders, order)))
        return order

    def next(self) -> Order | None:
        """The oldest order that is open."""
        return next((order for order in self.page.orders if order.state in OPEN), None)

    def note_agreed(self, stop_number: int) -> None:
        """Somebody agrees that it goes on with all that is open."""
        orders = tuple(
            replace(order, stop_number=stop_number) if order.state in OPEN else order
            for order in self.page.orders
        )
        self._change(replace(self.page, stop_number=stop_number, orders=orders, is_stopped=False))

    def note_way_home(self, *, is_stopped: bool) -> None:
        """The goal at home has ended; the next one has another number. ``is_stopped``: somebody ended it."""
        self._change(replace(self.page, ways_home=self.page.ways_home + 1, is_stopped=is_stopped))

    def note(self, order: Order, state: str, reason: str = "") -> None:
        """What became of an order."""
        self._change_order(order, state=state, reason=reason)

    def note_try(self, order: Order, *, is_stopped: bool) -> None:
        """The way to an order has ended, and is to be driven again. ``is_stopped``: somebody ended it."""
        self._change_order(order, {"is_stopped": is_stopped}, tries=order.tries + 1)

    def note_served(self, order: Order, stop_number: int) -> None:
        """Somebody has taken the food."""
        self._change_order(order, {"stop_number": stop_number}, state="served", reason="")

    def _change_order(self, order: Order, of_page: dict[str, Any] | None = None, **changes: Any) -> None:
        orders = tuple(
            replace(old, **changes) if old.number == order.number else old for old in self.page.orders
        )
        self._change(replace(self.page, orders=orders, **(of_page or {})))
