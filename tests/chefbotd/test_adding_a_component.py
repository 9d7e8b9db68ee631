"""docs/adding_a_component.md shows the component that ``chefbotd new-component`` writes, and it works as it stands."""

import asyncio
import math
import os
import re
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from chefbotd.bus import Bus
from chefbotd.cli.programs.chefbotd import main
from chefbotd.client import CallError
from chefbotd.client import models as client_models
from chefbotd.clock import ManualClock, run_virtual
from chefbotd.core.record import Record
from chefbotd.features.feature import Feature, methods_and_topics
from chefbotd.inputs import InputLog
from chefbotd.rpc.method import Method, method
from chefbotd.rpc.models import NoParams
from chefbotd.rpc.parameters import Role
from chefbotd.rpc.topics import Topic
from chefbotd.settings import SettingsError, load
from chefbotd.snapshot import DaemonState, encode_state
from chefbotd.testing.board import ScriptedBoard
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from tests.chefbotd.client.api_page import inputs_of
from tests.chefbotd.client.generate import written
from tests.chefbotd.rpc.test_guarded import broken_rules
from tests.fakes.robot import methods_of_socket, topics_of

PAGE = Path(__file__).parents[2] / "docs" / "adding_a_component.md"
pytestmark = pytest.mark.skipif(
    not PAGE.exists(), reason="the documentation is not part of an installed package"
)


def shown_files() -> dict[str, str]:
    """The files on the page by their names."""
    text = PAGE.read_text(encoding="utf-8")
    shown = re.findall(r"^`(chefbot_trip/\S+)` .*?```\w+\n(.*?)```", text, re.DOTALL | re.MULTILINE)
    return dict(shown)


@pytest.fixture
def trip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The package that the command writes, installed."""
    made = tmp_path / "made"
    done = CliRunner().invoke(main, ["new-component", "trip", "--into", str(made)])
    assert done.exit_code == 0, done.output
    information = made / "chefbot_trip-0.1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: chefbot-trip\nVersion: 0.1.0\n")
    points = re.findall(
        r'^(\[project\.entry-points\."chefbotd.components"\]\n.*)$',
        (made / "pyproject.toml").read_text(),
        re.MULTILINE,
    )
    assert points == ['[project.entry-points."chefbotd.components"]\ntrip = "chefbot_trip:COMPONENT"']
    (information / "entry_points.txt").write_text("[chefbotd.components]\ntrip = chefbot_trip:COMPONENT\n")
    monkeypatch.syspath_prepend(str(made))
    for name in [name for name in sys.modules if name.partition(".")[0] == "chefbot_trip"]:
        monkeypatch.delitem(sys.modules, name)
    return made


def test_what_it_says_next_can_be_typed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder as a path, which no index is asked for, with the pytest that the second line runs."""
    monkeypatch.chdir(tmp_path)
    said = CliRunner().invoke(main, ["new-component", "trip"]).output
    assert said.splitlines()[1].endswith(" --editable './chefbot-trip[test]'")
    assert said.splitlines()[2].endswith("/bin/pytest ./chefbot-trip")


def test_the_page_shows_what_the_command_writes(trip: Path) -> None:
    """Every file that it shows, to the letter."""
    shown = shown_files()
    assert {"chefbot_trip/__init__.py", "chefbot_trip/service.py", "chefbot_trip/card.js"} <= shown.keys()
    assert {name: (trip / name).read_text(encoding="utf-8") for name in shown} == shown


def test_a_new_component_passes_its_own_tests_and_runs(trip: Path) -> None:
    """Allowed, it is a method, a topic and a section; a wrong value of its section is refused by its name."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(trip), *sys.path])}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--rootdir={trip}", str(trip)]
    run = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert run.returncode == 0, run.stdout
    settings = load(overrides={"plugins.allow": ["trip"], "trip.wheel": 1})

    async def scenario() -> None:
        async with running_daemon(FakeSerialDevice(), settings) as client:
            assert {"method.reset_trip", "topic.trip"} <= set(client.hello.capabilities)
            assert (await client.call("reset_trip")) == {"turned_rad": 0.0}

    run_virtual(scenario())
    with pytest.raises(SettingsError, match=r"trip.wheel: input should be less than or equal to 1 \(got 7\)"):
        load(overrides={"plugins.allow": ["trip"], "trip.wheel": 7})


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    """The page's code of the service, as a module."""
    code = shown_files()["chefbot_trip/service.py"]
    module = types.ModuleType("page")
    monkeypatch.setitem(sys.modules, "page", module)
    exec(compile(code, str(PAGE), "exec"), vars(module))
    return module


def test_the_worked_example_runs(shown: types.ModuleType) -> None:
    """In a daemon on a scripted board: the method answers, the topic has data, the figure and the schemas are there."""
    device = FakeSerialDevice()
    board = ScriptedBoard(device)

    async def scenario() -> None:
        async with running_daemon(device, features=[shown.trip]) as client:
            await asyncio.sleep(0.1)
            for counts in ((0, 0), (30, -20), (80, -50), (140, -90)):
                board.cycle(*counts)
                await asyncio.sleep(0.02)
            async with client.subscribe("trip") as trips:
                turned_rad = (await anext(aiter(trips))).data.turned_rad
            counts_per_turn = load().encoders.counts_per_turn
            assert turned_rad == pytest.approx((30 + 50 + 60) * math.tau / counts_per_turn)
            ended = await client.call("reset_trip", turned_rad=2.5)
            assert ended == {"turned_rad": pytest.approx(turned_rad)}
            assert (await client.call("reset_trip"))["turned_rad"] == 2.5
            assert (await client.call("get_stats"))["trip_resets"] == 2
            described = await client.call("describe")
            assert (
                described["methods"]["reset_trip"]["summary"]
                == "Begin again; answers how far the wheel had turned."
            )
            assert described["methods"]["reset_trip"]["role"] == "drive"
            assert described["topics"]["stats"]["data"]["properties"]["trip_resets"]["type"] == "integer"

    run_virtual(scenario())


def test_the_role_of_the_worked_example_is_enforced(shown: types.ModuleType) -> None:
    """Who may only observe is refused; the example follows the rules for every method and for a replay as it stands."""

    async def scenario() -> None:
        settings = load(overrides={"api.default_role": "observe"})
        async with running_daemon(FakeSerialDevice(), settings, [shown.trip]) as client:
            with pytest.raises(CallError) as refused:
                await client.call("reset_trip")
            assert refused.value.kind == "forbidden"

    run_virtual(scenario())
    assert broken_rules({"reset_trip": added(shown)[0]["reset_trip"]}) == set()
    assert all(service.in_steps for service in shown.trip(Bus(), ManualClock()).services)


def test_the_worked_example_goes_on_from_a_recorded_state(shown: types.ModuleType) -> None:
    """What one has driven, another one goes on with; a state of anything else is refused."""
    one, other = (shown.trip(Bus(), ManualClock()).parts for _ in range(2))
    one["trip"].memory.turned_rad, one["trip"].memory.resets = 2.5, 3
    state = DaemonState(InputLog(ManualClock()), other, tuple, ())
    assert state.restore({"trip": encode_state(one["trip"].state())}) == []
    assert (other["trip"].memory.turned_rad, other["trip"].memory.resets) == (2.5, 3)
    (problem,) = state.restore({"trip": encode_state({"turned_rad": "far", "resets": 3})})
    assert "Expected `float`, got `str` - at `$.turned_rad`" in problem


def added(shown: types.ModuleType) -> tuple[dict[str, Method], dict[str, Topic]]:
    """The methods and topics of a socket, and those of the page."""
    methods, topics = methods_and_topics([shown.trip(Bus(), ManualClock())])
    return methods_of_socket() | methods, topics_of(simulated=True) | topics


def test_one_command_writes_all_else_that_the_worked_example_needs(
    shown: types.ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The typed method in both clients, the model, the type of the topic, the rows and the example on the page."""
    files = {path.name: text for path, text in written(*added(shown)).items()}
    assert "reset_trip = blocking(Client.reset_trip)" in files["generated_sync.py"]
    assert (
        'topics: Literal["trip"], **options: Unpack[Options]) -> Subscription[m.TripData]'
        in files["generated.py"]
    )
    assert "from page import TripData as TripData, TripEnded as TripEnded" in files["models.py"]
    assert '"trip": TripData' in files["models.py"]
    entry = inputs_of(files["api.md"])["reset_trip"]
    assert entry[:3] == (
        "Begin again; answers how far the wheel had turned.",
        "`turned_rad` = 0.0",
        "`turned_rad`",
    )
    assert (
        "| `trip` | How far the wheel has turned, in either direction, since it was reset" in files["api.md"]
    )
    ((request, answer),) = entry.examples
    assert (request["method"], answer["result"]) == ("reset_trip", {"turned_rad": 1.0})

    written_module: dict[str, Any] = {}
    exec(compile(files["generated.py"], "generated.py", "exec"), written_module)
    monkeypatch.setattr(client_models, "TripEnded", shown.TripEnded, raising=False)

    async def scenario() -> None:
        async with running_daemon(FakeSerialDevice(), features=[shown.trip]) as client:
            typed = type(
                "Typed", (written_module["GeneratedMethods"],), {"call": staticmethod(client.call)}
            )()
            assert await typed.reset_trip(2.5) == shown.TripEnded(turned_rad=0.0)
            assert await typed.reset_trip() == shown.TripEnded(turned_rad=2.5)

    run_virtual(scenario())


def test_two_features_with_one_topic_are_refused() -> None:
    """The error names the feature that came second, and what is taken."""
    topic = Topic("trip", (), Record, lambda _: Record())
    features = [Feature("first", topics=(topic,)), Feature("second", topics=(topic,))]
    with pytest.raises(ValueError, match="second: topic trip already belongs to another feature"):
        methods_and_topics(features)


def test_a_method_without_a_model_of_its_parameters_is_refused() -> None:
    """It is the function that is named, when its class is made."""

    def fly(self: object, caller: object, params: int) -> Record:
        raise NotImplementedError

    with pytest.raises(TypeError, match="fly: params must be annotated with a Params, got <class 'int'>"):
        method(role=None)(fly)


@pytest.mark.parametrize(
    ("role", "moves", "missing"),
    [
        (Role.DRIVE, None, "fly must say whether it moves the robot: moves=True or moves=False"),
        (Role.ADMIN, None, "fly must say whether it moves the robot: moves=True or moves=False"),
        (Role.OBSERVE, True, "fly moves the robot, so observers must not have it"),
        (None, True, "fly moves the robot, so observers must not have it"),
    ],
)
def test_a_method_says_whether_it_moves_the_robot(
    role: Role | None, moves: bool | None, missing: str
) -> None:
    """Nobody forgets it: a stop would void no request of such a method, and an observer could drive."""

    def fly(self: object, caller: object, params: NoParams) -> Record:
        raise NotImplementedError

    with pytest.raises(TypeError, match=missing.replace("(", r"\(")):
        method(role=role, moves=moves)(fly)
