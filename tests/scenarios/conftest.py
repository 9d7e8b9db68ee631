"""In the fast tier each scenario runs on one robot: on ChefBot or on KHAN, about half of the scenarios on each."""

import zlib
from collections import defaultdict

import pytest

from chefbotd.settings.errors import variable
from tests.scenarios.robots import AS_BUILT, ROBOTS


def robot_of(item: pytest.Item) -> str | None:
    """The packaged robot that a test's parameters name."""
    values = item.callspec.params.values() if hasattr(item, "callspec") else ()
    return next((value for value in values if isinstance(value, str) and value in ROBOTS), None)


@pytest.fixture(autouse=True)
def as_built(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every configuration that a scenario loads is that of a robot as built."""
    for key, value in AS_BUILT.items():
        monkeypatch.setenv(variable(tuple(key.split("."))), value)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the other robot's cases slow, of scenarios that both robots have."""
    cases = defaultdict(list)
    for item in items:
        robot = robot_of(item)
        if robot is not None and "tests/scenarios/" in item.nodeid and not item.get_closest_marker("slow"):
            cases[item.nodeid.partition("[")[0]].append((robot, item))
    for name, found in cases.items():
        chosen = ROBOTS[zlib.crc32(name.rpartition("::")[2].encode()) % 2]
        if {robot for robot, _ in found} == set(ROBOTS):
            for robot, item in found:
                if robot != chosen:
                    item.add_marker(pytest.mark.slow)
