"""How much is tried: a fast tier for every change, and everything for `make test-all`, `make check` and .ci/run.

`TEST_TIER=full` in the environment gives Hypothesis its full budget. What is marked `slow` is chosen by pytest's own
`-m`, as in `make test`.
"""

import os
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import settings

from tests.budget import FAST_EXAMPLES, IS_FULL

settings.register_profile("fast", max_examples=FAST_EXAMPLES, deadline=None)
settings.register_profile("full", deadline=None)
settings.load_profile("full" if IS_FULL else "fast")

HERE = Path(__file__).parent
NEED_NAVIGATION = (
    "chefbotd/cli/serve",
    "chefbotd/features/localization",
    "chefbotd/features/mapping",
    "chefbotd/localization",
    "chefbotd/mapping/slam",
    "chefbotd/navigation",
    "chefbotd/worker/skills",
    "scenarios/test_navigation.py",
)
"""Tests of what needs the extra ``navigation``; its compiled functions take half a minute where no cache has them."""

collect_ignore_glob = [] if find_spec("numba") and find_spec("scipy") else list(NEED_NAVIGATION)

_STATE = TemporaryDirectory(prefix="chefbotd-state-")
os.environ["XDG_STATE_HOME"] = (
    _STATE.name
)  # a real program that is tested leaves nothing in the developer's own

CONTROLLER = "PYTEST_XDIST_WORKER" not in os.environ


class _Executed:
    """How many tests were carried out, on this process or its workers: not those that were skipped."""

    count = 0


@pytest.hookimpl
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """One worker runs all tests that need the real clock, and one compiles for all tests that need it."""
    if not config.pluginmanager.hasplugin("xdist"):
        return
    rooms = {HERE / room for room in NEED_NAVIGATION}
    for item in items:
        if item.get_closest_marker("realtime"):
            item.add_marker(pytest.mark.xdist_group("realtime"))
        elif rooms.intersection((item.path, *item.path.parents)):
            item.add_marker(pytest.mark.xdist_group("compiled"))


@pytest.hookimpl
def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Count the tests that ran."""
    _Executed.count += report.when == "call" and not report.skipped


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """A run that carried out no test proves nothing: it fails, also where every test was skipped."""
    if CONTROLLER and exitstatus == 0 and not _Executed.count and not session.config.option.collectonly:
        session.exitstatus = pytest.ExitCode.NO_TESTS_COLLECTED
