"""A part of the fault matrix, and that all of it can fail; `make faults` runs it."""

import dataclasses
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.budget import sample
from tests.scenarios import by_tests, fault_run, matrix, navigation_run, process_faults, waiting_run
from tests.scenarios.by_tests import NOT_INJECTED, TestedRow
from tests.scenarios.fault_run import ENDED, Expected, Fault
from tests.scenarios.faults import BOARD_FAULTS, FAULTS
from tests.scenarios.faults.board import nothing, reset_by_itself
from tests.scenarios.faults.on_the_way import WAY_FAULTS
from tests.scenarios.faults.waiting import WAITING_FAULTS
from tests.scenarios.matrix import CLOCKS, VIRTUAL, Part, main, run, table, totals, trials
from tests.scenarios.robots import BOARDS, ROBOTS, SKETCHED
from tests.test_docs import PAGE, rows

PART = {
    "driver falls silent",
    "estop",
    "encoder reversed, wheel 0",
    "cable pulled for 1 s",
    "task lost: drive",
    "1 MB of TLS hello",
    "plain text on a TLS port",
    "another device at the start",
}
NAMES = {fault.name: fault for fault in FAULTS}
EVERY = [fault for part in CLOCKS["both"] for fault in part.faults]

NOT_APPLICABLE = {"tiva_bare": 5, "tiva_second": 5, "duemilanove": 3, "chefbot": 0}
"""Of how many faults each sketch has nothing that they could happen to."""

WITH_THE_PAGE = pytest.mark.skipif(
    not PAGE.exists(), reason="the documentation is not part of an installed package"
)


@pytest.fixture
def only(monkeypatch: pytest.MonkeyPatch) -> Callable[[Fault], None]:
    """From then on the matrix has one fault."""
    return lambda fault: monkeypatch.setitem(matrix.CLOCKS, "both", (Part(fault_run.attempt, [fault]),))


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_part_of_the_matrix_goes_as_defined(robot: str):
    """A fault of each sort has its one outcome, within its time, and is left again."""
    results = list(run(trials([robot], PART.__contains__)))
    assert {result.fault for result in results} == PART
    assert [result.wrong for result in results] == [()] * len(PART)
    assert totals(results)["faults injected"] == len(PART)
    assert table(results).row_count == len(PART)


WAYS = {fault.name: fault for fault in WAY_FAULTS}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["stairs in the only door", "e-stop on the way", "lidar turned by 180 degrees"]
)
def test_faults_on_the_way_to_a_goal_go_as_defined(name: str):
    """The goal has its one end, the robot rests in time, and nothing is touched."""
    result = navigation_run.attempt(WAYS[name], "chefbot")
    assert result.wrong == ()
    assert "goal" in result.outcome


@pytest.mark.slow
@pytest.mark.parametrize("fault", WAITING_FAULTS, ids=lambda fault: fault.name)
def test_what_waits_through_a_stop_begins_nothing(fault: waiting_run.WaitingFault):
    """The robot stands for 12 s after somebody has armed it, and drives when a person decides so."""
    assert waiting_run.attempt(fault, "chefbot").wrong == ()


@pytest.mark.slow
def test_another_end_of_a_goal_than_the_defined_one_fails():
    """Another end, other words, a robot that moves for too long, a silent log: each is told."""
    wrong = dataclasses.replace(
        WAYS["e-stop on the way"], end="reached", reason="a dog", rest_s=0.01, logged=("motors on fire",)
    )
    told = navigation_run.attempt(wrong, "chefbot").wrong
    assert [each.partition(" ")[0] for each in told] == ["moved", "ended", "said", "log"]


@pytest.mark.parametrize(
    ("expected", "complaint"),
    sample(
        [
            (Expected("estopped", None, 0.0001), "duty for 0.0"),
            (Expected("armed", None, 0.1), "told as ('estopped', None)"),
            (Expected("estopped", "wheel_stalled", 0.1), "told as ('estopped', None)"),
            (Expected("estopped"), "does not drive on"),
            (Expected("estopped", None, 0.1, ("motors on fire",)), "log has no 'motors on fire'"),
            (Expected(ENDED, None, 0.1), "told as ('estopped', None)"),
        ],
        fast=2,
    ),
)
def test_another_outcome_than_the_defined_one_fails(
    only: Callable[[Fault], None], tmp_path: Path, expected: Expected, complaint: str
):
    """Too late, another mode, another reason, a robot that stands or a log that is silent: told, and exit code 1."""
    only(dataclasses.replace(NAMES["estop"], expected=expected))
    assert main(["--robot", "chefbot", "--json", str(tmp_path / "faults.json")]) == 1
    told = json.loads((tmp_path / "faults.json").read_text())
    assert told["totals"]["survived"] == 0
    assert any(each.startswith(complaint) for each in told["results"][0]["wrong"])


def test_the_defined_outcome_passes(only: Callable[[Fault], None], tmp_path: Path):
    """The same fault as it is: exit code 0, and the figures are in the file."""
    only(NAMES["estop"])
    assert main(["--robot", "chefbot", "--json", str(tmp_path / "faults.json")]) == 0
    figures = json.loads((tmp_path / "faults.json").read_text())["totals"]
    assert list(figures) == [
        "faults injected",
        "survived",
        "not applicable",
        "worst stopping time",
        "frames lost",
        "clients lost",
    ]
    assert (figures["faults injected"], figures["survived"]) == (1, 1)


def test_a_trial_that_breaks_is_a_failure_and_the_others_go_on(capsys: pytest.CaptureFixture[str]):
    """No outcome is not the outcome that is defined."""

    def attempt(fault: Fault, robot: str) -> fault_run.Result:
        if fault.name == "estop":
            raise TimeoutError("never came back")
        return fault_run.attempt(fault, robot)

    planned = trials(["chefbot"], {"estop", "stop"}.__contains__, [Part(attempt, FAULTS)])
    broken, sound = run(planned)
    assert (broken.fault, sound.fault) == ("stop", "estop") or (broken.fault, sound.fault) == (
        "estop",
        "stop",
    )
    wrong = {result.fault: result.wrong for result in (broken, sound)}
    assert wrong == {"estop": ("no outcome: TimeoutError('never came back')",), "stop": ()}


@pytest.mark.parametrize(
    ("inject", "by_chance", "wrong"),
    [
        (reset_by_itself, {"board_restarted", "echo_mismatch"}, []),
        (nothing, {"board_restarted"}, []),
        (
            reset_by_itself,
            {"echo_mismatch"},
            ["told as ('disarmed', 'board_restarted')", "does not drive on"],
        ),
    ],
)
def test_what_ends_by_chance_ends_in_one_of_its_ways(
    inject: fault_run.Inject, by_chance: set[str], wrong: list[str]
) -> None:
    """It drives on or stands by one of the named faults, whichever it is; another one is wrong."""
    fault = Fault("row", "chance", inject, Expected(), on_wire=True, by_chance=frozenset(by_chance))
    assert list(fault_run.attempt(fault, "chefbot").wrong[:2]) == wrong


def test_whatever_ends_by_chance_never_races(monkeypatch: pytest.MonkeyPatch) -> None:
    """Driven at 0.2 m/s where 0.1 m/s were allowed: that is wrong, whatever it ended in."""
    monkeypatch.setattr(fault_run, "FASTEST_M_S", 0.1)
    fault = Fault("row", "chance", nothing, Expected(), by_chance=frozenset({"board_restarted"}))
    (told,) = fault_run.attempt(fault, "chefbot").wrong
    assert told.startswith("drove at 0.2")


@pytest.mark.slow
@pytest.mark.parametrize("robot", SKETCHED[1:])
def test_what_a_sketch_makes_a_difference_to_goes_as_defined(robot: str):
    """Resets, restarts, a board that reads nothing, what its lines do not tell: each has its outcome or a reason."""
    wanted = ("board re", "cable and power", "battery critical", "wall ahead", "range sensor")
    results = list(run(trials([robot], lambda name: name.startswith(wanted))))
    assert len(results) > 10
    assert [(result.fault, result.wrong) for result in results if result.wrong] == []
    assert totals(results)["not applicable"] == NOT_APPLICABLE[robot[8:]]


def test_each_sketch_has_every_fault_that_its_board_makes_a_difference_to():
    """All that is on the board's side of the daemon is planned for all of them; what is not, for both robots."""
    planned = trials(BOARDS)
    on = {robot: {trial.fault.name for trial in planned if trial.robot == robot} for robot in BOARDS}
    board = {fault.name for fault in BOARD_FAULTS if "chefbot" in fault.robots}
    assert all(on[robot] == board for robot in SKETCHED[1:])
    assert (
        board < on["chefbot"] == {each.name for p in VIRTUAL for each in p.faults if "chefbot" in each.robots}
    )


def test_a_reason_is_given_for_each_fault_that_a_sketch_cannot_have():
    """The table of the run says it, and the trial counts neither as injected nor as survived."""
    results = list(run(trials(["chefbot/duemilanove"], {"battery critical"}.__contains__)))
    assert [result.not_applicable for result in results] == ["its sketch does not tell the battery's voltage"]
    figures = totals(results)
    assert (figures["faults injected"], figures["survived"], figures["not applicable"]) == (0, 0, 1)
    assert "does not tell the battery" in str(table(results).columns[-1]._cells)


@pytest.mark.slow
def test_processes_that_share_the_matrix_find_what_one_finds():
    """Two processes give the same results, to the last digit and in the same order."""
    planned = trials(["chefbot"], {"estop", "stop", "encoder reversed, wheel 0"}.__contains__)
    assert list(run(planned, jobs=2)) == list(run(planned))


def test_a_choice_of_nothing_is_a_failure(capsys: pytest.CaptureFixture[str]):
    """A name that no fault has tries nothing, and so proves nothing."""
    assert main(["--only", "dragons"]) == 1
    assert "faults injected: 0" in capsys.readouterr().out


@pytest.mark.slow
def test_the_program_exits_as_main_says():
    """As `make faults` calls it, in a process of its own."""
    command = [
        sys.executable,
        "-m",
        "tests.scenarios.matrix",
        "--clock",
        "virtual",
        "--robot",
        "khan",
        "--only",
    ]
    codes = [
        subprocess.run([*command, name], check=False, capture_output=True).returncode
        for name in ("gains", "??")
    ]
    assert codes == [0, 1]


def test_names_are_told_apart():
    """Two faults with one name would share a line of the table."""
    names = [fault.name for fault in EVERY]
    assert sorted(set(names)) == sorted(names)


def row_of(fault: Any) -> list[str]:
    """The row of docs/safety.md that it stands in."""
    cells = rows()
    found = [row for row in cells if row[0] == fault.row] or [
        row for row in cells if row[0].startswith(fault.row)
    ]
    assert len(found) == 1, f"{fault.name}: {len(found)} rows begin with {fault.row!r}"
    return found[0]


@WITH_THE_PAGE
def test_every_row_of_the_page_is_injected():
    """Each fault stands in one row of docs/safety.md, and each row has a fault, but for those that happen elsewhere."""
    by_its_tests = {fault.row for fault in EVERY if isinstance(fault, TestedRow)}
    injected = {row_of(fault)[0] for fault in EVERY if not isinstance(fault, TestedRow)}
    assert [row[0] for row in rows() if row[0] not in injected | by_its_tests] == []
    assert not injected & by_its_tests
    assert all(any(row.startswith(start) for row in by_its_tests) for start in NOT_INJECTED)


@WITH_THE_PAGE
@pytest.mark.parametrize(
    ("test", "wrong"),
    [
        ("test_names_are_told_apart", ()),
        ("test_that_is_away", ("pytest ended with 4",)),
    ],
)
def test_a_row_that_is_not_injected_is_as_good_as_its_tests(test: str, wrong: tuple[str, ...]):
    """One that passes, and one that is not there; where an add-on is not installed, nothing is claimed."""
    row = TestedRow("Row", "a row", (f"tests/scenarios/test_matrix.py::{test}",))
    assert by_tests.attempt(row, "chefbot").wrong == wrong
    away = dataclasses.replace(row, tests=("addons/chefbot-nowhere/tests/test_it.py::test_it",))
    assert by_tests.attempt(away, "chefbot").not_applicable == "chefbot-nowhere is not installed"


@WITH_THE_PAGE
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_the_page_says_what_is_told_and_logged(fault: Fault):
    """What a run expects of the topic `safety` and of the log stands in its row."""
    _, _, _, seen, logged, *_ = row_of(fault)
    kind = fault.expected.kind
    assert kind is None or f"`{re.sub(':.*', ':', kind)}" in seen
    for entry in fault.expected.logged:
        assert f"`{entry}`" in logged


@WITH_THE_PAGE
@pytest.mark.parametrize("fault", WAY_FAULTS, ids=lambda fault: fault.name)
def test_the_page_says_how_goals_end(fault: navigation_run.WayFault):
    """A goal that is not reached has its end, and the log its entry, in the fault's row."""
    _, _, _, seen, logged, *_ = row_of(fault)
    assert fault.end == "reached" or f"`{fault.end}`" in seen
    for entry in fault.logged:
        assert f"`{entry}`" in logged


@WITH_THE_PAGE
@pytest.mark.parametrize("ending", process_faults.PROCESS_FAULTS, ids=lambda ending: ending.name)
def test_the_page_says_how_the_program_ends(ending: process_faults.Ending):
    """So does what a run of the real program expects."""
    _, does, _, seen, logged, *_ = row_of(ending)
    assert ending.exit_code != 0 or "exit code 0" in does
    assert ending.expected.kind is None or f"`{ending.expected.kind}`" in seen or seen == "the same"
    for entry in ending.expected.logged:
        assert f"`{entry}`" in logged or logged == "the same"
