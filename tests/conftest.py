"""How much is tried: a fast tier for every change, and everything for `make test-all`, `make check` and .ci/run.

`TEST_TIER=full` in the environment gives Hypothesis its full budget. What is marked `slow` is chosen by pytest's own
`-m`, as in `make test`. `TEST_TIER=rest` runs, with the full budget, what `make test` has left to be run.
"""

import gc
import os
import signal
from collections.abc import Generator, Iterator
from functools import cache
from importlib.util import find_spec
from tempfile import TemporaryDirectory
from typing import Any

import pytest
import structlog
from hypothesis import HealthCheck, settings

from chefbotd.components.simulation.compiled_firmware import NoCompilerError
from tests.budget import FAST_EXAMPLES, IS_FULL, TIER, is_left
from tests.firmware.tools import refuse
from tests.groups import COMPILED, NEED_NAVIGATION, group_of

# A shell starts a job in the background with SIGINT ignored, and the programs that are tested would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# How fast examples are made and run says how busy the machine is, and nothing of the code.
PATIENT = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("fast", PATIENT, max_examples=FAST_EXAMPLES)
settings.register_profile("full", PATIENT)
settings.load_profile("full" if IS_FULL else "fast")

# A traceback that is drawn with colours and local variables takes half a second; nobody reads those of the tests.
structlog.configure(
    processors=[
        *structlog.get_config()["processors"][:-1],
        structlog.dev.ConsoleRenderer(exception_formatter=structlog.dev.plain_traceback),
    ]
)


@pytest.fixture(autouse=True)
def _log_as_before() -> Iterator[None]:
    """A command that sets up the log for its own process does so for no other test."""
    before = structlog.get_config()
    yield
    structlog.configure(**before)


@cache
def _compile() -> None:
    """Compile all that the worker's skills need, or load it from the cache."""
    from chefbotd.components.localization.algorithms import warm as localization
    from chefbotd.components.mapping.algorithms import warm as mapping
    from chefbotd.components.navigation.algorithms import warm as navigation
    from chefbotd.components.navigation.algorithms.interface import NavigationParameters
    from chefbotd.components.navigation.algorithms.outline import Footprint

    mapping.warm()
    localization.warm()
    navigation.warm(NavigationParameters(outline=Footprint(radius_m=0.18)))


@pytest.fixture(autouse=True)
def _compiled_before(request: pytest.FixtureRequest) -> None:
    """Compiling takes minutes on a busy machine: no test's time limit counts it, whichever test comes first."""
    if group_of(request.path) == COMPILED:
        _compile()


collect_ignore_glob = [] if find_spec("numba") and find_spec("scipy") else list(NEED_NAVIGATION)

_STATE = TemporaryDirectory(prefix="chefbotd-state-")
os.environ["XDG_STATE_HOME"] = (
    _STATE.name
)  # a real program that is tested leaves nothing in the developer's own

CONTROLLER = "PYTEST_XDIST_WORKER" not in os.environ


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Nothing that is collected becomes garbage: looking for some took a quarter of the time, in every process.

    The collector passes over it while the tests run, too.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With ``TEST_TIER=rest``: leave out what `make test` runs alike."""
    if TIER == "rest":
        done = [item for item in items if not is_left(item)]
        items[:] = [item for item in items if is_left(item)]
        config.hook.pytest_deselected(items=done)


def _lack_of_compiler(error: BaseException | None) -> BaseException | None:
    """The error that says so, where it is this one's cause."""
    while error is not None and not isinstance(error, NoCompilerError):
        error = error.__cause__
    return error


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call() -> Generator[None, object, object]:
    """A test whose simulated board runs our own firmware is skipped where that can be neither loaded nor compiled."""
    try:
        return (yield)
    except Exception as error:
        if (cause := _lack_of_compiler(error)) is None:
            raise
        return refuse(str(cause))


class _Executed:
    """How many tests were carried out, on this process or its workers: not those that were skipped."""

    count = 0


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With ``--dist loadgroup``: which process runs which tests is decided here."""
    if config.getoption("dist") != "loadgroup":
        return None
    from tests.scheduling import GroupScheduling  # xdist may not be installed

    return GroupScheduling(config, log)


@pytest.hookimpl
def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Count the tests that ran."""
    _Executed.count += report.when == "call" and not report.skipped


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """A run that carried out no test proves nothing: it fails, also where every test was skipped."""
    if CONTROLLER and exitstatus == 0 and not _Executed.count and not session.config.option.collectonly:
        session.exitstatus = pytest.ExitCode.NO_TESTS_COLLECTED
