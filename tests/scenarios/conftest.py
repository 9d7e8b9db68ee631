"""In the fast tier each scenario runs on one robot: on ChefBot or on KHAN, about half of the scenarios on each."""

import zlib
from collections import defaultdict

import pytest

ROBOTS = ("chefbot", "khan")


def robot_of(item: pytest.Item) -> str | None:
    """The packaged robot that a test's parameters name."""
    values = item.callspec.params.values() if hasattr(item, "callspec") else ()
    return next((value for value in values if isinstance(value, str) and value in ROBOTS), None)


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
