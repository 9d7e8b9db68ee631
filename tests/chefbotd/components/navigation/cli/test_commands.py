"""``chefbotctl go``, ``patrol`` and ``where`` against a daemon that answers what the test says."""

import contextlib
import json
import math
from collections.abc import AsyncIterator
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner, Result

from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.programs.chefbotctl import main
from chefbotd.client import GoalBlocked
from chefbotd.client.errors import GoalFault, GoalNotReached, GoalUnreachable, RobotLost, not_reached
from chefbotd.components.navigation.cli import commands
from chefbotd.components.navigation.cli.view import NavigationScene
from chefbotd.components.navigation.models import NavigationData


class Robot:
    """Remembers where it was sent; ``error`` is raised by every goal, ``state`` is what ``get_state`` answers."""

    def __init__(self) -> None:
        self.goals: list[dict[str, Any]] = []
        self.error: Exception | None = None
        self.state: dict[str, Any] = {}

    async def navigate_to(self, **goal: Any) -> str:
        self.goals.append(goal)
        if self.error is not None:
            raise self.error
        return "reached (1.20, 3.40)"

    async def go_home(self) -> str:
        return await self.navigate_to(home=True)

    async def dock(self) -> str:
        return await self.navigate_to(dock=True)

    async def call(self, method: str, **params: Any) -> dict[str, Any]:
        assert method == "get_state"
        return self.state


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Robot:
    """In the place of the client; nothing is drawn."""
    robot = Robot()

    def run(self: CommandContext, action: Any, **options: Any) -> Any:
        return self.run(action(robot))

    async def without_screen(robot: Any, scene: Any, show: Any, drive: Any) -> Any:
        return await drive(robot)

    monkeypatch.setattr(CommandContext, "run_with_client", run)
    monkeypatch.setattr(commands, "_watch_goal", without_screen)
    return robot


def chefbotctl(*arguments: str) -> Result:
    """Run it."""
    return CliRunner().invoke(main, list(arguments))


@pytest.mark.parametrize(
    ("words", "goal"),
    [
        (["table", "3"], {"place": "table 3"}),
        (["1.2", "-3.4"], {"x_m": 1.2, "y_m": -3.4}),
        (["1.2", "3.4", "90"], {"x_m": 1.2, "y_m": 3.4, "heading_rad": math.pi / 2}),
        (["1.2", "3.4", "1000"], {"x_m": 1.2, "y_m": 3.4, "heading_rad": math.radians(-80)}),
        (["7"], {"place": "7"}),
        (["--tolerance", "0.5", "kitchen"], {"place": "kitchen", "tolerance_m": 0.5}),
    ],
)
def test_go_takes_a_place_or_a_pose(robot: Robot, words: list[str], goal: dict[str, Any]) -> None:
    """Two or three numbers are a pose, with the heading in degrees; all else is a place, its words joined."""
    result = chefbotctl("go", *words)
    assert result.exit_code == 0, result.output
    assert robot.goals == [pytest.approx(goal) if "x_m" in goal else goal]
    assert result.output.endswith("Reached (1.20, 3.40).\n")


def test_home_and_dock_are_commands_of_their_own(robot: Robot) -> None:
    """Each asks for its method, and ends as ``go`` does."""
    for command in ("home", "dock"):
        result = chefbotctl(command)
        assert result.exit_code == 0, result.output
        assert result.output.endswith("Reached (1.20, 3.40).\n")
    assert robot.goals == [{"home": True}, {"dock": True}]
    robot.error = GoalBlocked(4, "blocked for 60 s: something is in the way at (3.10, 4.02)")
    assert chefbotctl("dock").exit_code == 6


def test_a_goal_that_is_not_reached_ends_with_its_reason(robot: Robot) -> None:
    """Exit code 6, the robot's own sentence for people, the kind of the end for scripts."""
    robot.error = GoalBlocked(4, "blocked for 60 s: something is in the way at (3.10, 4.02)")
    result = chefbotctl("go", "kitchen")
    assert (result.exit_code, "in the way at (3.10, 4.02)" in result.output) == (6, True)
    told = json.loads(chefbotctl("--json", "go", "kitchen").output.splitlines()[-1])
    assert "blocked" in json.dumps(told)


def test_patrol_goes_round_in_order_and_ends_with_the_first_that_fails(robot: Robot) -> None:
    """Two rounds of two places are four goals; a place that is not reached is the last."""
    result = chefbotctl("patrol", "--rounds", "2", "door", "table 3")
    assert result.exit_code == 0, result.output
    assert [goal["place"] for goal in robot.goals] == ["door", "table 3", "door", "table 3"]
    robot.goals, robot.error = [], GoalUnreachable(5, "unreachable: the door is closed")
    assert chefbotctl("patrol", "door", "table 3").exit_code == 6
    assert len(robot.goals) == 1


def test_where_says_the_pose_only_while_it_is_known(robot: Robot) -> None:
    """Localized: pose, map and fit. Lost: the last pose is not told, for it is wrong."""
    pose = {"x_m": 1.234, "y_m": -0.5, "heading_rad": -math.pi / 2}
    known = {"state": "localized", "map": "flat", "fit": 0.947, "alternatives": [], "reason": ""}
    robot.state = {"localization": known, "topics": {"map_pose": {"data": pose, "age_s": 0.1}}}
    assert (
        "The robot is at (1.23 m, -0.50 m, -90°) on the map flat: localized, fit 0.95."
        in chefbotctl("where").output
    )
    known["state"] = "lost"
    told = chefbotctl("where").output
    assert "does not know where it is on the map flat (lost)" in told
    assert "1.23" not in told


def test_where_names_each_place_where_the_robot_may_be(robot: Robot) -> None:
    """Two rooms that look alike: both, with their fits; and what keeps it from finding out."""
    places = [
        {"x_m": 1.0, "y_m": 2.0, "heading_rad": 0.0, "fit": 0.93},
        {"x_m": 5.5, "y_m": 2.0, "heading_rad": math.pi, "fit": 0.91},
    ]
    known = {"state": "searching", "map": "flat", "fit": 0.9, "alternatives": places, "reason": ""}
    robot.state = {"localization": known, "topics": {}}
    assert chefbotctl("where").output.splitlines() == [
        "The robot does not know where it is on the map flat (searching; it may be at 2 places).",
        "  (1.00 m, 2.00 m, 0°), fit 0.93",
        "  (5.50 m, 2.00 m, 180°), fit 0.91",
    ]


def test_where_before_anything_was_told_does_not_say_that_there_is_no_lidar(robot: Robot) -> None:
    """The worker is still being started."""
    nothing = {"state": "unknown", "map": None, "fit": 0.0, "alternatives": [], "reason": ""}
    robot.state = {"localization": nothing, "topics": {}}
    result = chefbotctl("where")
    assert (result.exit_code, result.output) == (0, "The robot does not know where it is (unknown).\n")


def test_where_tells_an_old_pose_as_old(robot: Robot) -> None:
    """The lidar is silent: when the robot was there, and why it is not sure any more."""
    pose = {"x_m": 1.0, "y_m": 2.0, "heading_rad": 0.0}
    why = "no scan of the lidar 'lidar' for 7 s"
    known = {"state": "uncertain", "map": "flat", "fit": 0.0, "alternatives": [], "reason": why}
    robot.state = {"localization": known, "topics": {"map_pose": {"data": pose, "age_s": 7.4}}}
    told = chefbotctl("where").output
    assert "The robot was 7 s ago at (1.00 m, 2.00 m, 0°) on the map flat: uncertain" in told
    assert f"{why}." in told


def test_where_on_a_robot_without_a_lidar_says_what_is_missing(robot: Robot) -> None:
    """Exit code 4."""
    result = chefbotctl("where")
    assert (result.exit_code, "has no [[lidar]]" in result.output) == (4, True)


@pytest.mark.parametrize(
    ("end", "kind"),
    [("unreachable", GoalUnreachable), ("lost", RobotLost), ("fault", GoalFault), ("new", GoalNotReached)],
)
def test_each_end_has_an_error_of_its_own(end: str, kind: type[GoalNotReached]) -> None:
    """With the goal's number, its end and the robot's sentence; an end that is not known yet is the base's."""
    error = not_reached(7, end, "because")
    assert type(error) is kind
    assert (error.goal, error.end, error.reason, str(error)) == (7, end, "because", "because")


def test_how_the_goal_before_ended_is_not_told_as_what_the_robot_does() -> None:
    """The topic's latest value comes first, and it is of somebody else's goal: the line "reached" would be wrong."""
    scene = NavigationScene(doing="to kitchen")
    before = NavigationData(state="reached", goal=7, reason="reached (2.45, 2.62)")
    scene.take_event(SimpleNamespace(topic="navigation", data=before))
    assert (scene.state, scene.reason) == ("idle", "")
    for data in (
        NavigationData(state="driving", goal=8, reason="drives to (6.40, 1.60)"),
        NavigationData(state="blocked", goal=8, reason="blocked for 60 s"),
    ):
        scene.take_event(SimpleNamespace(topic="navigation", data=data))
        assert (scene.state, scene.reason) == (data.state, data.reason)


class Searching(Robot):
    """Is lost where it stands, and knows where it is when it has turned, if ``helps``."""

    def __init__(self, *, helps: bool) -> None:
        super().__init__()
        self.turns: list[bool] = []
        self.looked = False
        self._helps = helps

    async def localize(self, *, turn: bool = False) -> Any:
        """It begins to look; a turn is at its end."""
        self.turns.append(turn)
        found = turn and self._helps
        state = "localized" if found else "lost"
        known = {"state": state, "map": "flat", "fit": 0.9, "alternatives": [], "reason": ""}
        pose = {"data": {"x_m": 1.0, "y_m": 2.0, "heading_rad": 0.0}, "age_s": 0.1}
        self.state = {"localization": known, "topics": {"map_pose": pose} if found else {}}
        return SimpleNamespace(state=state, reason="it has turned once" if turn else "")

    @contextlib.asynccontextmanager
    async def subscribe(self, topic: str) -> AsyncIterator[AsyncIterator[Any]]:
        assert topic == "localization"
        yield self._states("searching" if self.turns else "localized")

    async def _states(self, first: str) -> AsyncIterator[Any]:
        """As it stands when it is subscribed to, and then: before it was asked to look, it was sure."""
        yield SimpleNamespace(data=SimpleNamespace(state=first))
        self.looked = True
        yield SimpleNamespace(data=SimpleNamespace(state=self.state["localization"]["state"]))


@pytest.mark.parametrize(
    ("arguments", "helps", "exit_code", "told"),
    [
        ((), True, 6, "does not know where it is on the map flat (lost)"),
        (("--turn",), True, 0, "The robot is at (1.00 m, 2.00 m, 0°)"),
        (("--turn",), False, 6, "it has turned once; The robot does not know where it is"),
    ],
)
def test_localize_has_the_robot_turn_only_if_it_is_asked_to(
    monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], helps: bool, exit_code: int, told: str
) -> None:
    """Without --turn it stands and says that it is lost; with it, the daemon has it turn, and says what came of it."""
    searching = Searching(helps=helps)
    monkeypatch.setattr(
        CommandContext, "run_with_client", lambda self, action, **options: self.run(action(searching))
    )
    result = chefbotctl("localize", *arguments)
    assert result.exit_code == exit_code, result.output
    assert told in " ".join(result.output.split())
    assert searching.turns == [bool(arguments)]
    assert searching.looked is not bool(arguments)


def completed(words: str) -> list[str]:
    """What bash would offer."""
    request = {
        "_CHEFBOTCTL_COMPLETE": "bash_complete",
        "COMP_WORDS": f"chefbotctl {words}",
        "COMP_CWORD": str(len(words.split())),
    }
    lines = CliRunner().invoke(main, prog_name="chefbotctl", env=request).output.split("\n")
    return [line.removeprefix("plain,") for line in lines if line]


@pytest.mark.parametrize("command", ["go", "patrol sofa"])
def test_the_shell_completes_places(robot: Robot, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    """Those of the map in use that begin so, whatever their case."""

    async def list_places() -> SimpleNamespace:
        return SimpleNamespace(places=[SimpleNamespace(name=name) for name in ("kitchen", "Kiosk", "sofa")])

    monkeypatch.setattr(robot, "list_places", list_places, raising=False)
    assert completed(f"{command} ki") == ["kitchen", "Kiosk"]


def test_without_a_daemon_the_shell_completes_nothing() -> None:
    """It prints no error into the command line."""
    assert completed("--connect 127.0.0.1:1 go ki") == []
