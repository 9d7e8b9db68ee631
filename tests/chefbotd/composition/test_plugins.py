"""Plug-ins: packages that offer a feature by an entry point, in a whole daemon on the virtual clock."""

import asyncio
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from structlog.testing import capture_logs

from chefbotd import installed as composition
from chefbotd.cli.common.state_text import Style, of_state
from chefbotd.cli.programs.chefbotd import main
from chefbotd.client import Client
from chefbotd.clock import run_virtual
from chefbotd.components.doctor.algorithms.finding import Verdict
from chefbotd.components.doctor.algorithms.host import check_plugins
from chefbotd.rpc.models import PluginDescription, PluginState
from chefbotd.settings import Settings, SettingsError, load
from chefbotd.testing.board import ScriptedBoard
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice

METADATA = "Metadata-Version: 2.1\nName: {package}\nVersion: 1.2\n"
ENTRY = "[chefbotd.features]\n{name} = {module}:plugin\n"
HEAD = """
from chefbotd.features.feature import Feature, Service
from chefbotd.features.plugin import Plugin
from chefbotd.rpc.method import method, methods_of
from chefbotd.rpc.models import DONE, Done, NoParams
from chefbotd.rpc.parameters import Role
"""

Install = Callable[..., None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Puts a package with a plug-in on the path, as pip would."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def install(name: str, code: str, *, package: str = "") -> None:
        package = package or f"chefbot-{name}"
        module = package.replace("-", "_")
        monkeypatch.delitem(sys.modules, module, raising=False)
        (tmp_path / f"{module}.py").write_text(HEAD + code)
        folder = tmp_path / f"{module}-1.2.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(METADATA.format(package=package))
        (folder / "entry_points.txt").write_text(ENTRY.format(name=name, module=module))

    return install


def with_daemon(settings: Settings, check: Callable[[Client], Any]) -> Any:
    """What ``check`` returns, called with a client of a daemon with this configuration."""
    device = FakeSerialDevice()
    ScriptedBoard(device)

    async def scenario() -> Any:
        async with running_daemon(device, settings) as client:
            await asyncio.sleep(0.1)
            return await check(client)

    return run_virtual(scenario())


async def plugins(client: Client) -> dict[str, tuple[str, str]]:
    """The state of each plug-in, and why."""
    listed = (await client.list_plugins()).plugins
    assert (await client.describe()).plugins == listed
    return {plugin.name: (str(plugin.state), plugin.reason) for plugin in listed}


GREET = """
class Greeter:
    @method(role=Role.OBSERVE)
    def get_{name}(self, caller, params: NoParams) -> Done:
        "Greet."
        return DONE

plugin = Plugin(api=1, build=lambda context: Feature("{name}", methods=methods_of(Greeter())))
"""


def test_a_new_plugin_works_as_it_stands(
    install: Install, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own test passes; allowed, it is a method and a topic of the daemon, with its settings; else it is nothing."""
    made = tmp_path / "made"
    assert CliRunner().invoke(main, ["new-plugin", "wheel_trip", "--into", str(made)]).exit_code == 0
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(made), *sys.path])}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--rootdir={made}", str(made)]
    run = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert run.returncode == 0, run.stdout
    assert '[project.entry-points."chefbotd.features"]\nwheel_trip = "chefbot_wheel_trip:plugin"' in (
        (made / "pyproject.toml").read_text()
    )
    install("wheel_trip", (made / "chefbot_wheel_trip.py").read_text().partition("\n")[2])

    async def check(client: Client) -> list[bool]:
        capabilities = client.hello.capabilities
        return ["method.reset_wheel_trip" in capabilities, "topic.wheel_trip" in capabilities]

    assert with_daemon(load(), check) == [False, False]
    overrides = {"plugins.allow": ["wheel_trip"], "plugins.settings": {"wheel_trip": {"wheel": 1}}}
    allowed = load(overrides=overrides)
    assert with_daemon(allowed, check) == [True, True]
    assert with_daemon(allowed, plugins) == {"wheel_trip": ("running", "")}


@pytest.mark.parametrize(
    ("code", "state", "reason"),
    [
        ("raise OSError('no camera')", "failed", "OSError: no camera"),
        ("raise SystemExit(3)", "failed", "SystemExit: 3"),
        (
            "plugin = Plugin(api=1, build=lambda context: exit('no camera'))",
            "failed",
            "SystemExit: no camera",
        ),
        (
            "plugin = Plugin(api=1, build=lambda context: Feature('bad', services=3))",
            "failed",
            "TypeError: 'int' object is not iterable",
        ),
        (
            "plugin = Plugin(api=1, build=lambda context: Feature('bad', services=(Service('look', 5),)))",
            "failed",
            "TypeError: expected services with a name and a function",
        ),
        ("raise KeyboardInterrupt('no')", "failed", "KeyboardInterrupt: no"),
        ("import asyncio\nraise asyncio.CancelledError('no')", "failed", "CancelledError: no"),
        ("class Odd(BaseException): pass\nraise Odd('no')", "failed", "Odd: no"),
        (
            "class Odd(BaseException): pass\ndef build(context): raise Odd('no')\nplugin = Plugin(api=1, build=build)",
            "failed",
            "Odd: no",
        ),
        ("plugin = 7", "failed", "chefbot_bad:plugin: expected a Component, got 7"),
        (
            "plugin = Plugin(api=2, build=None)",
            "incompatible",
            "it was written for version 2 of the plug-ins' interface, this chefbotd has 1",
        ),
        (
            "plugin = Plugin(api=1, build=lambda context: context.settings['port'])",
            "failed",
            "KeyError: 'port'",
        ),
        (
            "plugin = Plugin(api=1, build=lambda context: None)",
            "failed",
            "TypeError: expected a Feature from",
        ),
        (
            "plugin = Plugin(api=1, build=lambda context: Feature('board'))",
            "failed",
            "ValueError: there is a feature named 'board' already",
        ),
        (
            "plugin = Plugin(api=1, build=lambda context: Feature('discovery'))",
            "failed",
            "ValueError: there is a feature named 'discovery' already",
        ),
        (
            "plugin = Plugin(api=1, build=lambda context: Feature('bad', services=(Service('link', print),)))",
            "failed",
            "ValueError: service 'link' already belongs to the feature 'board'",
        ),
        (
            "plugin = Plugin(api=1, build=lambda context: Feature('bad', services=2 * (Service('look', print),)))",
            "failed",
            "ValueError: service 'look' already belongs to the feature 'bad'",
        ),
        (GREET.format(name="state"), "failed", "ValueError: method get_state belongs to the server"),
        (
            GREET.format(name="stats"),
            "failed",
            "ValueError: bad: method get_stats already belongs to another",
        ),
    ],
)
def test_a_plugin_that_cannot_be_loaded_is_said_and_left_out(
    install: Install, code: str, state: str, reason: str
) -> None:
    """The robot runs, and the plug-in behind it in the list, too."""
    install("bad", code.replace('Feature("stats"', 'Feature("bad"'))
    install("good", GREET.format(name="good"))
    with capture_logs() as lines:
        states = with_daemon(load(overrides={"plugins.allow": ["bad", "good"]}), plugins)
    assert states["good"] == ("running", "")
    assert states["bad"][0] == state
    assert states["bad"][1].startswith(reason)
    errors = [line for line in lines if line["event"] == "a plug-in is left out"]
    assert [(line["plugin"], line["reason"]) for line in errors] == [("bad", states["bad"][1])]


@pytest.mark.parametrize(
    "code",
    [
        "import time\ntime.sleep(1000)",
        "while True:\n    pass",
        "while True:\n    try:\n        __import__('time').sleep(1000)\n    except Exception:\n        pass",
        "import time\nplugin = Plugin(api=1, build=lambda context: time.sleep(1000))",
    ],
    ids=["sleeps", "loops", "catches", "builds"],
)
def test_a_plugin_that_hangs_at_its_start_is_interrupted_said_and_left_out(
    install: Install, monkeypatch: pytest.MonkeyPatch, code: str
) -> None:
    """The others run, and a client is told why this one does not."""
    monkeypatch.setattr(composition, "LOADED_WITHIN_S", 0.5)
    install("bad", code)
    install("good", GREET.format(name="good"))
    with capture_logs() as lines:
        states = with_daemon(load(overrides={"plugins.allow": ["bad", "good"]}), plugins)
    assert states == {"bad": ("failed", "Hangs: it was not ready within 0.5 s"), "good": ("running", "")}
    assert "a plug-in hangs at its start: nothing is served until it ends" in [
        line["event"] for line in lines
    ]


def test_a_plugin_that_is_not_installed_or_offered_twice_is_said_and_left_out(install: Install) -> None:
    """Nothing is guessed."""
    install("twice", GREET.format(name="one"), package="a-package")
    install("twice", GREET.format(name="two"), package="b-package")
    states = with_daemon(load(overrides={"plugins.allow": ["absent", "twice"]}), plugins)
    assert states == {
        "absent": (
            "not_found",
            "no installed package has an entry point 'absent' in the group chefbotd.components",
        ),
        "twice": ("failed", "more than one package offers it: a-package, b-package"),
    }


def test_a_plugin_whose_figures_clash_runs_without_them(install: Install) -> None:
    """Another part has a figure of this name already."""
    install(
        "figures",
        "plugin = Plugin(api=1, build=lambda context: Feature('figures', add_metrics=lambda metrics: "
        "metrics.counters('bus_dropped', 'Again.', 'event', dict)))",
    )
    with capture_logs() as lines:
        states = with_daemon(load(overrides={"plugins.allow": ["figures"]}), plugins)
    assert states == {"figures": ("running", "")}
    (error,) = [line for line in lines if line["event"] == "a plug-in's figures are left out"]
    assert "there is a metric named 'bus_dropped' already" in error["reason"]


@pytest.mark.parametrize(
    ("overrides", "reason"),
    [
        ({"plugins.allow": ["a", "a"]}, "each plug-in is allowed once, got a more often"),
        ({"plugins.settings": {"a": {}}}, "settings for a, which plugins.allow does not name: it has []"),
    ],
)
def test_a_bad_list_is_refused_with_what_is_wrong(overrides: dict[str, object], reason: str) -> None:
    """A key for a plug-in that does not run would be silently without effect."""
    with pytest.raises(SettingsError) as refusal:
        load(overrides=overrides)
    assert reason in str(refusal.value)


RUNS = PluginDescription("trip", "chefbot-trip", "1.2", PluginState.RUNNING)
ABSENT = PluginDescription("absent", "", "", PluginState.NOT_FOUND, "no installed package has it")


def test_status_and_doctor_name_each_plugin_and_why_it_does_not_run() -> None:
    """A plug-in that is left out is a problem with a remedy."""
    good, bad = check_plugins([RUNS, ABSENT])
    assert (good.verdict, good.measured) == (Verdict.OK, "chefbot-trip 1.2 runs")
    assert (bad.verdict, bad.measured) == (Verdict.PROBLEM, "it is left out: no installed package has it")
    assert bad.advice.startswith("install its package")
    listed = [
        {"name": plugin.name, "version": plugin.version, "reason": plugin.reason} for plugin in (RUNS, ABSENT)
    ]
    state = {"safety": {"armed": False, "mode": "x", "reason": ""}, "link": {"state": "down", "device": ""}}
    state["link"] |= {"reason": ""}
    fact = of_state({**state, "topics": {}, "plugins": listed})[-1]
    assert (fact.label, fact.style) == ("plugins", Style.NOTICE)
    assert fact.text == "trip 1.2; absent is left out: no installed package has it"
