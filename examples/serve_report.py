"""What came of ``chefbotctl serve``, for people and for scripts."""

import math
from typing import Any

from msgspec.structs import asdict
from rich import box
from rich.table import Table

from chefbotd.components.navigation.cli.view import NavigationView
from chefbotd.core.record import Record
from examples.legs import Leg

COLUMNS = (
    "leg to",
    "length, over shortest",
    "time, over ideal",
    "closest approach",
    "true error at the goal",
)


class Found(Record, frozen=True):
    """How it found out where it was: after how long, and how far from the truth."""

    seconds: float
    off_m: float
    off_rad: float
    turned: bool


class Served(Record, frozen=True):
    """What came of it; all times are by the robot's clock. ``late`` is what is to be said of a busy computer."""

    found: Found
    legs: tuple[Leg, ...]
    seconds: float
    late: str = ""

    @property
    def failures(self) -> tuple[str, ...]:
        """Why it does not count as done; nothing where it does."""
        return tuple(leg.failure for leg in self.legs if leg.failure is not None)


def print_report(view: NavigationView, served: Served) -> None:
    """How it found out where it was, and a table of the legs."""
    view.print(found_text(served), _table(served.legs))
    if served.late:
        view.print(f"{served.late[0].upper()}{served.late[1:]}, and all times are by that clock.")


def found_text(served: Served) -> str:
    """How it found out where it was."""
    start = served.found
    how = "turning where it stood" if start.turned else "without a motion"
    off = f"{100 * start.off_m:.1f} cm and {math.degrees(start.off_rad):.1f} degrees off the truth"
    return f"It found out where it was within {start.seconds:.1f} s, {how}: {off}."


def _table(legs: tuple[Leg, ...]) -> Table:
    table = Table(*COLUMNS, box=box.SIMPLE_HEAD, pad_edge=False)
    for leg in legs:
        table.add_row(*row(leg))
    return table


def row(leg: Leg) -> tuple[str, ...]:
    """A leg in words; one that failed says why."""
    if leg.failure is not None:
        return (leg.place, f"{leg.length_m:.1f} m", f"{leg.seconds:.0f} s", _cm(leg.closest_m), leg.failure)
    return (
        leg.place,
        f"{leg.length_m:.1f} m, {leg.length_m / leg.shortest_m:.2f}",
        f"{leg.seconds:.0f} s, {leg.seconds / leg.ideal_s:.2f}",
        _cm(leg.closest_m),
        f"{_cm(leg.off_m)}, {math.degrees(leg.off_rad):.1f} degrees",
    )


def _cm(metres: float) -> str:
    return f"{100 * metres:.1f} cm" if math.isfinite(metres) else "?"


def as_json(served: Served) -> dict[str, Any]:
    """The same for a script."""
    return {
        "found": asdict(served.found),
        "legs": [{name: _finite(value) for name, value in asdict(leg).items()} for leg in served.legs],
        "seconds": served.seconds,
        "late": served.late or None,
        "failures": list(served.failures),
    }


def _finite(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value
