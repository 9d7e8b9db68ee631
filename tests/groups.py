"""Which tests share a process where the tests run on all cores: decided by their files."""

from functools import cache
from pathlib import Path

HERE = Path(__file__).parent
NEED_NAVIGATION = (
    "chefbotd/components/navigation/cli",
    "chefbotd/components/localization",
    "chefbotd/components/mapping",
    "chefbotd/components/localization/algorithms",
    "chefbotd/components/mapping/algorithms/slam",
    "chefbotd/components/navigation/algorithms",
    "chefbotd/components/simulation/test_compiled_beams.py",
    "chefbotd/components/worker/skills",
    "examples",
    "scenarios/test_navigation.py",
    "scenarios/test_navigation_maps.py",
    "scenarios/test_navigation_sensing.py",
)
"""Tests of what needs the extra ``navigation``; its compiled functions take half a minute where no cache has them."""

COMPILED = "compiled"
"""The group that these are."""


@cache
def group_of(path: Path) -> str:
    """The tests of one group run in one process, in turn; most files are a group of their own.

    xdist's own groups are written into a test's id, which pytest 9.2 no longer lets it change.
    """
    if "mark.realtime" in path.read_text(encoding="utf-8"):
        return "realtime"
    rooms = {HERE / room for room in NEED_NAVIGATION}
    return COMPILED if rooms.intersection((path, *path.parents)) else str(path)
