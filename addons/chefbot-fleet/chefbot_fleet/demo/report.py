"""What the demonstration measures from the robots' true poses, and the table at its end."""

import itertools
import math
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import click

from chefbot_fleet.roadmap import Point
from chefbotd.components.simulation.truth_file import Truth

AT_PLACE_M: Final = 0.5
"""So near its place a robot is to be loaded and unloaded."""

Worked = Sequence[tuple[str, Point]]
WORDS: Final = ("load", "take")
"""What people are asked for at an order's first place, and at its second."""

Task = tuple[str, str]
"""One of ``WORDS``, and an order."""


class Measured:
    """Of each robot how far it has driven, how long it waited for others, what it touched; and how near two came.

    Seconds are those of the robots' clock.
    """

    def __init__(self, serials: Sequence[str]) -> None:
        self.driven_m, self.waited_s = dict.fromkeys(serials, 0.0), dict.fromkeys(serials, 0.0)
        self.touches = Counter(dict.fromkeys(serials, 0))
        self.touched: list[str] = []  # a sentence for each touch
        self.nearest_m, self.seconds = math.inf, 0.0
        self._begun_s, self._begun = -math.inf, time.monotonic()
        self._points: dict[str, Point] = {}
        self._touched: dict[str, int] = {}
        self._waits: set[str] = set()

    @property
    def pace(self) -> float:
        """How fast the robots' clock went, by real time."""
        return self.seconds / max(time.monotonic() - self._begun, 1e-6)

    def waits(self, serials: set[str]) -> None:
        """These robots wait from now on."""
        self._waits = serials

    def take(self, truths: Mapping[str, Truth | None]) -> None:
        """The truth now; None where it is not known at the moment."""
        known = {serial: truth for serial, truth in truths.items() if truth is not None}
        if not known:
            return
        now_s = max(truth.stamp_s for truth in known.values())
        self._begun_s = now_s if self._begun_s == -math.inf else self._begun_s
        passed_s, self.seconds = now_s - self._begun_s - self.seconds, now_s - self._begun_s
        for serial in self._waits:
            self.waited_s[serial] += passed_s
        for serial, truth in known.items():
            point = truth.world_from_base.x_m, truth.world_from_base.y_m
            self.driven_m[serial] += math.dist(point, self._points.get(serial, point))
            self._points[serial] = point
            if touches := max(truth.touches - self._touched.get(serial, truth.touches), 0):
                self.touches[serial] += touches
                places = ", ".join(
                    f"{one} ({x_m:.2f}, {y_m:.2f})" for one, (x_m, y_m) in self._points.items()
                )
                self.touched.append(f"{serial} touched something after {self.seconds:.0f} s: {places}")
            self._touched[serial] = truth.touches
        for one, other in itertools.combinations(self._points.values(), 2):
            self.nearest_m = min(self.nearest_m, math.dist(one, other))


def report(
    measured: Measured,
    orders: Mapping[str, tuple[str, str]],
    worked: Mapping[str, Worked],
    places: Mapping[str, Point],
) -> bool:
    """Print the table; whether every order was done once, where it was to be done, and nothing touched."""
    lost, twice = 0, 0
    for done in tasks(orders, worked).values():
        lost, twice = lost + (not done), twice + (len(done) > 1)
    elsewhere = count_elsewhere(orders, worked, places)
    touches = measured.touches.total()
    click.echo(f"\n{'robot':8}{'driven (m)':>12}{'waited (s)':>12}{'loads, unloads':>16}{'touches':>9}")
    for serial, one in worked.items():
        driven_m, waited_s = measured.driven_m[serial], measured.waited_s[serial]
        click.echo(f"{serial:8}{driven_m:12.0f}{waited_s:12.0f}{len(one):16}{measured.touches[serial]:9}")
    for sentence in measured.touched:
        click.echo(sentence)
    click.echo(
        f"\n{len(orders)} orders in {measured.seconds:.0f} s of the robots' clock, which went at {measured.pace:.2f} "
        f"times real time:\n{lost} loads and unloads lost, {twice} done twice, {elsewhere} elsewhere; {touches} "
        f"touches, the nearest two robots {measured.nearest_m:.2f} m from middle to middle"
    )
    return not (lost or twice or elsewhere or touches)


def tasks(orders: Iterable[str], worked: Mapping[str, Worked]) -> dict[Task, list[tuple[str, Point]]]:
    """Of each order the loads and unloads: which robots people did them for, and where those stood."""
    return {
        (word, name): [
            (serial, point)
            for serial, done in worked.items()
            for question, point in done
            if f" {word} {name} " in f"{question} "
        ]
        for name in orders
        for word in WORDS
    }


def count_elsewhere(
    orders: Mapping[str, tuple[str, str]], worked: Mapping[str, Worked], places: Mapping[str, Point]
) -> int:
    """How many loads and unloads were done more than ``AT_PLACE_M`` from where they were to be done."""
    return sum(
        any(math.dist(point, places[orders[name][WORDS.index(word)]]) > AT_PLACE_M for _, point in done)
        for (word, name), done in tasks(orders, worked).items()
    )
