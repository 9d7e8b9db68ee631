"""Conclusions about the computer, the port and the service."""

from collections.abc import Mapping

import pytest

from chefbotd.components.doctor.algorithms.finding import Verdict
from chefbotd.components.doctor.algorithms.host import (
    PortFound,
    check_baud,
    check_configuration,
    check_device,
    check_governor,
    check_holder,
    check_permission,
    check_priority,
    check_service,
    check_time_sync,
)
from chefbotd.core.record import replace

PORT = PortFound("/dev/ttyACM0", exists=True)


def test_a_device_that_is_not_there():
    """The other ports are named."""
    gone = replace(PORT, exists=False, others="available serial ports: /dev/ttyUSB0")
    finding = check_device(gone)
    assert finding.verdict is Verdict.PROBLEM
    assert "the device /dev/ttyACM0 does not exist; available serial ports: /dev/ttyUSB0" in finding.measured
    assert check_permission(gone).verdict is Verdict.SKIPPED


def test_no_permission():
    """What gives it is the advice."""
    finding = check_permission(
        replace(PORT, permission="only members of the group dialout may use it: run 'sudo usermod ...'")
    )
    assert finding.verdict is Verdict.PROBLEM
    assert "dialout" in finding.advice


@pytest.mark.parametrize(
    ("held_by", "answers", "verdict"),
    [
        ("", False, Verdict.OK),
        ("chefbotd (pid 7)", True, Verdict.OK),
        ("chefbotd (pid 7)", False, Verdict.PROBLEM),
        ("minicom (pid 9)", False, Verdict.PROBLEM),
        ("minicom (pid 9)", True, Verdict.PROBLEM),
    ],
)
def test_who_holds_the_port(held_by: str, answers: bool, verdict: Verdict):
    """Only the daemon that answers may; anybody else is named."""
    finding = check_holder(replace(PORT, held_by=held_by), daemon_answers=answers)
    assert finding.verdict is verdict
    assert held_by in finding.measured


def test_baud_rates():
    """The configured one, another one, and none."""
    assert check_baud(115_200, 115_200, heard_anything=True).verdict is Verdict.OK
    wrong = check_baud(57_600, 115_200, heard_anything=True)
    assert wrong.verdict is Verdict.PROBLEM
    assert wrong.advice == "set [link] baud = 115200"
    assert check_baud(57_600, None, heard_anything=True).verdict is Verdict.PROBLEM
    assert check_baud(57_600, None, heard_anything=False).verdict is Verdict.SKIPPED


LOADED = {"LoadState": "loaded", "ActiveState": "active", "UnitFileState": "enabled", "Result": "success"}


@pytest.mark.parametrize(
    ("unit", "verdict", "said"),
    [
        (None, Verdict.SKIPPED, "systemd does not run"),
        ({"LoadState": "not-found"}, Verdict.SKIPPED, "no unit"),
        (LOADED, Verdict.OK, "active and enabled"),
        ({**LOADED, "UnitFileState": "disabled"}, Verdict.WARNING, "disabled"),
        ({**LOADED, "ActiveState": "inactive"}, Verdict.WARNING, "inactive"),
        (
            {**LOADED, "ActiveState": "failed", "Result": "exit-code", "ExecMainStatus": "78"},
            Verdict.PROBLEM,
            "exit-code with exit code 78",
        ),
    ],
    ids=["no systemd", "not installed", "well", "disabled", "inactive", "failed"],
)
def test_the_service(unit: Mapping[str, str] | None, verdict: Verdict, said: str):
    """Active, enabled, and how it ended last."""
    finding = check_service(unit)
    assert finding.verdict is verdict
    assert said in finding.measured


def test_the_loops_priority():
    """Real time is well, ordinary is a warning with what to do, and what is not known is not judged."""
    real_time = check_priority(10, 0, 50_000, daemon_answers=True)
    assert real_time.verdict is Verdict.OK
    assert "real-time priority 10, and its memory is locked" in real_time.measured
    ordinary = check_priority(0, -10, 0, daemon_answers=True)
    assert ordinary.verdict is Verdict.WARNING
    assert "nice -10" in ordinary.measured


@pytest.mark.parametrize(
    ("answers", "said"),
    [(True, "a daemon answers, but its process cannot be told"), (False, "no daemon answers")],
)
def test_a_daemon_that_answers_is_not_said_to_be_missing(answers: bool, said: str):
    """Which process it is may be unknown all the same."""
    finding = check_priority(None, 0, 0, daemon_answers=answers)
    assert finding.verdict is Verdict.SKIPPED
    assert said in finding.measured


def test_governor_clock_and_configuration():
    """A processor that saves power, a clock that is not kept, and another robot's configuration."""
    assert check_governor([]).verdict is Verdict.SKIPPED
    assert check_governor(["schedutil", "performance"]).verdict is Verdict.OK
    assert check_governor(["powersave", "performance"]).verdict is Verdict.WARNING
    assert [check_time_sync(each).verdict for each in (None, True, False)] == [
        Verdict.SKIPPED,
        Verdict.OK,
        Verdict.WARNING,
    ]
    assert check_configuration("a.toml", wanted_robot="chefbot", robot="khan").verdict is Verdict.PROBLEM
    assert check_configuration("a.toml", wanted_robot="chefbot", robot="").verdict is Verdict.OK
