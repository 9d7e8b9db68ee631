"""Every command of chefbotctl against a daemon, on a virtual clock: what it asks, prints and exits with."""

import asyncio
import contextlib
import json
import math
import re
from collections.abc import Coroutine
from functools import partial
from typing import Any, TypeVar

import pytest
from click.testing import CliRunner

from chefbotd import __version__
from chefbotd.cli.common.arguments import Address
from chefbotd.cli.common.context import CommandContext
from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.programs.chefbotctl import main
from chefbotd.clock import run_virtual
from chefbotd.transport.ports import reserve_port
from tests.chefbotd.cli.fake_daemon import FakeDaemon
from tests.chefbotd.conftest import Control

T = TypeVar("T")
RIGHT_TURN = {"x_m": -1, "y_m": 2, "heading_rad": -math.pi / 2}


@pytest.mark.parametrize(
    ("args", "method", "params"),
    [
        (["stop"], "stop", {}),
        (["estop"], "estop", {}),
        (["estop", "--reason", "smoke"], "estop", {"reason": "smoke"}),
        (["reset-board"], "reset_board", {}),
        (["reset-odometry"], "reset_odometry", {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0}),
        (["reset-odometry", "-1", "2", "-90"], "reset_odometry", RIGHT_TURN),
        (["pid", "get"], "get_pid", {}),
        (
            ["pid", "set", "left", "kp=420", "conditional_integration=false", "back_calculation_s=none"],
            "set_pid",
            {"wheel": "left", "kp": 420.0, "conditional_integration": False, "back_calculation_s": None},
        ),
        (["pid", "undo"], "undo_pid", {}),
        (["describe"], "describe", {}),
    ],
)  # fmt: skip
def test_commands_ask_for_what_they_say(
    control: Control, daemon: FakeDaemon, args: list[str], method: str, params: dict[str, Any]
) -> None:
    """Each command becomes one call with its arguments in SI units, and exits with 0."""
    result = control(*args)
    assert (result.exit_code, result.stderr) == (0, "")
    assert [(name, given) for _, name, given in daemon.calls] == [(method, params)]


@pytest.mark.parametrize(
    "args", [["stop"], ["pid", "get"], ["describe"], ["status"], ["drive", "0.1", "0", "--for", "1"]]
)
def test_json_is_one_object(control: Control, args: list[str]) -> None:
    """With --json the output is one JSON object and nothing else."""
    assert isinstance(json.loads(control("--json", *args).stdout), dict)


def test_status_tells_everything(control: Control) -> None:
    """The status shows mode, link, pose, speed, wheels, battery, ranges, truth and what went wrong."""
    told = " ".join(control("status").stdout.split())
    for words in (
        "mode armed, nobody drives",
        "link up on /dev/ttyACM0",
        "pose x +0.000 m y +0.000 m heading +0.0°",
        "speed +0.000 m/s +0.000 rad/s 0.004 s",
        "left +1.00 rad/s (+1), right -2.00 rad/s (+0)",
        "battery 12.34 V, 78 %, ok",
        "front 1.50 m",
        "truth x +1.000 m",
        "200 lines in, 50 out",
        "1 lines refused",
        "2 board restarts",
    ):
        assert words in told


def test_gains_are_shown_by_wheel(control: Control) -> None:
    """A row a gain, a column a wheel; what is off is named as it is set."""
    rows = [line.split() for line in control("pid", "set", "left_wheel", "kp=420").stdout.splitlines()]
    assert ["gain", "left_wheel", "right_wheel"] in rows
    assert ["kp", "420", "400"] in rows
    assert ["back_calculation_s", "none", "none"] in rows


def test_describe_names_methods_and_topics(control: Control) -> None:
    """A row for each of what can be called and watched: its fields, none of them cut, and what it is for."""
    told = " ".join(control("describe").stdout.split())
    assert re.search(r"method drive if_stop_number .*Drive at this velocity linear_m_s", told)
    assert re.search(r"method ping .*Answer at once", told)
    assert re.search(r"topic battery voltage_v .*The battery", told)
    assert "…" not in told


def test_watch_prints_events(control: Control, daemon: FakeDaemon) -> None:
    """Watching asks for the topics at the rate and policy given, and ends after the count."""
    result = control("watch", "battery", "ranges", "--rate", "5", "--count", "3", "--ordered")
    assert daemon.calls[0][1:] == (
        "subscribe",
        {"topics": ["battery", "ranges"], "max_rate_hz": 5.0, "policy": "ordered"},
    )
    lines = result.stdout.splitlines()
    assert len(lines) == 3
    assert lines[0].endswith("battery voltage_v=12.34 percentage=78 status=ok")
    assert " ranges ranges=[{sensor=front,status=ok,range_m=1.5,min_range_m=0.02," in lines[1]


def test_watch_tells_numbers_from_words(control: Control) -> None:
    """Counts are written as numbers, an absent source as none, a condition as true."""
    lines = control("watch", "wheels", "safety", "--count", "2").stdout.splitlines()
    assert " duty=[1,0] " in lines[0]
    assert " source=none armed=true " in lines[1]


def test_watch_as_json_lines(control: Control) -> None:
    """With --json each event is one JSON line with its topic, stamp, age and data."""
    event = json.loads(control("--json", "watch", "battery", "--count", "1").stdout)
    assert (event["topic"], event["age_s"], event["data"]["status"]) == ("battery", 0.004, "ok")


def test_watch_completes_topics() -> None:
    """The shell completes the names of the topics."""
    request = {
        "_CHEFBOTCTL_COMPLETE": "bash_complete",
        "COMP_WORDS": "chefbotctl watch ba",
        "COMP_CWORD": "2",
    }
    assert CliRunner().invoke(main, prog_name="chefbotctl", env=request).output.strip() == "plain,battery"


def test_drive_repeats_and_ends_at_zero(control: Control, daemon: FakeDaemon) -> None:
    """A drive of 1 s sends 20 commands at 20 Hz, then zero and its source back, and says that odometry went 0.2 m."""
    result = control("--json", "drive", "0.2", "0", "--for", "1")
    driven = [at_s for at_s, name, given in daemon.calls if name == "drive" and given["linear_m_s"]]
    assert len(driven) == pytest.approx(20, abs=1)
    assert driven[-1] - driven[0] == pytest.approx(0.95, abs=0.05)
    methods = daemon.methods()
    assert methods[:3] == ["set_client_name", "get_state", "drive"]
    assert methods[-3:] == ["drive", "release_control", "get_state"]
    answer = json.loads(result.stdout)
    assert answer["moved"]["x_m"] == pytest.approx(0.2, abs=0.01)
    assert answer["happened"]


@pytest.mark.parametrize("args", [["-0.1", "-0.2", "--for", "0.1"], ["--for", "0.1", "--", "-0.1", "-0.2"]])
def test_drive_takes_negative_numbers(control: Control, daemon: FakeDaemon, args: list[str]) -> None:
    """Negative speeds need no quoting, with or without a double dash."""
    result = control("drive", *args)
    assert (result.exit_code, result.stdout[:5]) == (0, "Moved")
    assert daemon.calls[2][2] == {"linear_m_s": -0.1, "angular_rad_s": -0.2}


def test_drive_waits_until_the_robot_stands(control: Control, daemon: FakeDaemon) -> None:
    """What was rolled after the stop counts: 1 s and the dead-man's 0.5 s at 0.2 m/s are 0.3 m."""
    daemon.coasts = True
    answer = json.loads(control("--json", "drive", "0.2", "0", "--for", "1").stdout)
    assert answer["moved"]["x_m"] == pytest.approx(0.29, abs=0.02)


def test_a_drive_that_does_not_happen(control: Control, daemon: FakeDaemon) -> None:
    """When odometry sees no motion the exit code says so."""
    daemon.stuck = True
    result = control("drive", "0.2", "0", "--for", "1")
    assert result.exit_code == Exit.NOT_DONE
    assert "odometry saw next to no motion" in result.stderr


def test_a_drive_is_judged_by_what_was_allowed(control: Control) -> None:
    """Of 1000 m/s the fake allows 50, and goes 50 m in a second: that has happened, and what was cut is told."""
    result = control("drive", "1000", "0", "--for", "1")
    first, second = result.stdout.splitlines()
    assert (result.exit_code, result.stderr) == (0, "")
    assert first == "Limited by limits.linear to +50.000 m/s  +0.000 rad/s."
    assert second.startswith("Moved, seen from the start: x +5")


def test_scripts_are_told_what_was_allowed(control: Control) -> None:
    """With ``--json`` the velocity and the limit have keys of their own."""
    answer = json.loads(control("--json", "drive", "1000", "0", "--for", "1").stdout)
    assert answer["allowed"] == {"linear_m_s": 50.0, "angular_rad_s": 0.0}
    assert (answer["limited_by"], answer["held_by"], answer["happened"]) == ("limits.linear", None, True)


def test_what_held_the_robot_up_is_told(control: Control, daemon: FakeDaemon) -> None:
    """Before a wall the error is not about motors only."""
    daemon.stuck, daemon.held_by = True, "obstacle:front"
    assert control("drive", "0.2", "0", "--for", "1").stderr.endswith("; slowed by obstacle:front\n")


@pytest.mark.parametrize("args", [["0", "3.1416"], ["0", "-3.1416"], ["0.2", "3.1416"]])
def test_a_full_turn_counts_as_motion(control: Control, args: list[str]) -> None:
    """Turning by 2 s of 3.1416 rad/s ends where it began, in place or along a circle, and has happened."""
    result = control("--json", "drive", *args, "--for", "2")
    assert (result.exit_code, json.loads(result.stdout)["happened"]) == (0, True)


@pytest.mark.parametrize("args", [["0", "3.1416"], ["0.2", "6"]])
def test_a_full_turn_that_does_not_happen(control: Control, daemon: FakeDaemon, args: list[str]) -> None:
    """Motors that stand are noticed however far they were asked to turn."""
    daemon.stuck = True
    assert control("drive", *args, "--for", "2").exit_code == Exit.NOT_DONE


def test_arm_undoes_only_what_has_latched_when_it_is_typed(control: Control, daemon: FakeDaemon) -> None:
    """It asks for the number of the last latch, none so far, and arms with it."""
    assert control("arm").exit_code == Exit.OK
    assert [(name, given) for _, name, given in daemon.calls] == [("get_state", {}), ("arm", {"latch": 0})]


def test_refusals_name_their_kind(control: Control, daemon: FakeDaemon) -> None:
    """A refused drive exits with 4, prints the kind, and has given its source back all the same."""
    daemon.refuse["drive"] = "estopped"
    result = control("--json", "drive", "0.2", "0", "--for", "1")
    assert result.exit_code == Exit.REFUSED
    error = json.loads(result.stderr)["error"]
    assert error == {"exit_code": 4, "message": "estopped: it will not", "kind": "estopped"}
    assert daemon.methods()[-2:] == ["drive", "release_control"]


def test_a_lost_connection(control: Control, daemon: FakeDaemon) -> None:
    """A daemon that goes away in the middle is told from one that was never there."""
    daemon.hang_up_on = "arm"
    result = control("arm")
    assert result.exit_code == Exit.CONNECTION_LOST
    assert "Error: lost the daemon" in result.stderr


@pytest.mark.parametrize(
    ("kind", "advice"),
    [("lease_held", "--take-over"), ("unauthenticated", "--token-file"), ("disarmed", "it will not\n")],
)
def test_a_refusal_says_what_to_type(control: Control, daemon: FakeDaemon, kind: str, advice: str) -> None:
    """Where an option of ours helps, it is named; the rest is the daemon's own words."""
    daemon.refuse["drive"] = kind
    told = control("drive", "0.2", "0", "--for", "1").stderr
    assert told.startswith(f"Error: {kind}: it will not")
    assert advice in told


async def say_only(words: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """A server of another kind: says this, and waits until its client goes."""
    writer.write(words)
    with contextlib.suppress(ConnectionError):
        await reader.read()
    writer.close()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (b"", "(no greeting within 5 s); if it is a chefbotd that speaks TLS, --ca is needed"),
        (b"HTTP/1.0 400 Bad Request\r\n\r\n", "sent no JSON object: b'HTTP/1.0 400 Bad Request\\r')"),
    ],
)
def test_somebody_else_listens(words: bytes, told: str) -> None:
    """What is no chefbotd is no lost connection; what it said first is told."""

    async def main() -> None:
        async with await asyncio.start_server(partial(say_only, words), "127.0.0.1", 0) as server:
            address = Address("127.0.0.1", server.sockets[0].getsockname()[1])
            try:
                await CommandContext(address).with_client(lambda robot: robot.stop())
            finally:
                await asyncio.sleep(0.1)  # for the other end to close

    with pytest.raises(ProgramError) as caught:
        run_virtual(main())
    assert caught.value.code == Exit.CANNOT_CONNECT
    assert str(caught.value).endswith(told)


def test_another_protocol(control: Control, daemon: FakeDaemon) -> None:
    """A daemon of another major version is not talked to."""
    daemon.protocol = "2.0"
    assert control("arm").exit_code == Exit.CANNOT_CONNECT
    assert daemon.calls == []


def test_nobody_listens() -> None:
    """Without a daemon the message names the address and asks the right question."""
    port = reserve_port()
    result = CliRunner().invoke(main, ["stop"], env={"CHEFBOTCTL_CONNECT": f"127.0.0.1:{port}"})
    assert result.exit_code == Exit.CANNOT_CONNECT
    assert f"cannot connect to 127.0.0.1:{port} (Connection refused); is chefbotd running" in result.stderr


def test_no_such_host() -> None:
    """A host name that does not resolve says so."""
    result = CliRunner().invoke(main, ["--connect", "no-such-host.invalid:7333", "stop"])
    assert result.exit_code == Exit.CANNOT_CONNECT


@pytest.mark.parametrize(
    "args",
    [
        ["drive", "0.1", "0"],
        ["square", "--robot", "chefbot"],
        ["square", "--sim", "--robot", "no-such-robot"],
        ["drive", "fast", "0", "--for", "1"],
        ["drive", "nan", "0", "--for", "1"],
        ["drive", "0.1", "0", "--for", "0"],
        ["drive", "0.1", "0", "--fro", "1"],
        ["watch"],
        ["watch", "imu", "--rate", "-1"],
        ["pid", "set", "left"],
        ["pid", "set", "left", "kp"],
        ["pid", "set", "left", "kp=much"],
        ["pid", "set", "left", "kp=1", "kp=2"],
        ["pid", "set", "left", "wheel=1"],
        ["--connect", "localhost", "stop"],
        ["--connect", "::1:99999", "stop"],
        ["--connect", "::1:80", "stop"],
        ["--connect", "host:80000", "stop"],
        ["dance"],
    ],
)
def test_wrong_arguments(args: list[str]) -> None:
    """What cannot be meant is a usage error, before anything is connected."""
    assert CliRunner().invoke(main, args).exit_code == Exit.USAGE


def test_interruption_stops_the_robot(daemon: FakeDaemon) -> None:
    """Ctrl-C in the middle of a drive cancels it, and zero is commanded on the way out."""

    async def interrupted(work: Coroutine[Any, Any, T]) -> None:
        task = asyncio.ensure_future(work)
        await asyncio.sleep(0.5)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    def run(work: Coroutine[Any, Any, T]) -> T:
        daemon.run(interrupted(work))
        raise KeyboardInterrupt

    args = [f"--connect=127.0.0.1:{daemon.port}", "drive", "0.2", "0", "--for", "5"]
    result = CliRunner().invoke(main, args, obj=run)
    assert (result.exit_code, result.stderr) == (Exit.INTERRUPTED, "Interrupted.\n")
    assert daemon.methods()[-2:] == ["drive", "release_control"]
    assert daemon.twist.linear_m_s == 0


def test_version_and_help() -> None:
    """The version is the package's, and the help explains the exit codes."""
    assert __version__ in CliRunner().invoke(main, ["--version"]).output
    assert "  4  the robot refused" in CliRunner().invoke(main, ["--help"]).output


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts(shell: str) -> None:
    """Each shell gets a script that asks chefbotctl for completions."""
    result = CliRunner().invoke(main, ["completion", shell])
    assert result.exit_code == 0
    assert "_CHEFBOTCTL_COMPLETE" in result.output
