"""chefbotctl record and log list: what is asked of the daemon, and what people and scripts read."""

import asyncio
import json
from collections.abc import Coroutine
from typing import Any, TypeVar

import pytest
from click.testing import CliRunner

from chefbotd.cli.common.arguments import duration
from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs.chefbotctl import main
from tests.chefbotd.cli.fake_daemon import FakeDaemon
from tests.chefbotd.conftest import Control

T = TypeVar("T")


def times_of(daemon: FakeDaemon, *methods: str) -> list[float]:
    """When these were called."""
    return [at_s for at_s, method, _ in daemon.calls if method in methods]


@pytest.mark.parametrize(("text", "seconds"), [("3s", 3.0), ("0.1m", 6.0)])
def test_a_recording_lasts_as_long_as_was_asked(
    daemon: FakeDaemon, control: Control, text: str, seconds: float
) -> None:
    """It begins with the name, ends after that time, and what came of it is told."""
    result = control("record", "evening", "--for", text)
    assert result.exit_code == 0, result.output
    assert ("start_recording", {"name": "evening"}) in [(m, p) for _, m, p in daemon.calls]
    began_s, ended_s = times_of(daemon, "start_recording", "stop_recording")
    assert ended_s - began_s == pytest.approx(seconds, abs=0.1)
    assert "Recorded 12.5 s, 321 messages, 4.2 MB: /recordings/evening_1.mcap" in result.output


def test_times_are_given_in_units() -> None:
    """Seconds where there is none."""
    assert [duration(each) for each in ("7", "7.5s", "1.5m", "2h")] == [7.0, 7.5, 90.0, 7200.0]


@pytest.mark.parametrize("text", ["0", "-3s", "soon", "s", "inf"])
def test_a_time_that_is_none_is_refused(control: Control, text: str) -> None:
    """Before anything is asked of the daemon."""
    result = control("record", f"--for={text}")
    assert result.exit_code == Exit.USAGE
    assert "such as 10s, 5m or 1h" in result.output


def test_ctrl_c_ends_a_recording_in_order(daemon: FakeDaemon) -> None:
    """It is the usual end: the recording is ended, what came of it is told, and the exit code is 0."""

    def interrupted(work: Coroutine[Any, Any, T]) -> T:
        async def ended_after_a_while() -> T:
            task = asyncio.ensure_future(work)
            asyncio.get_running_loop().call_later(3.0, task.cancel)
            return await task

        return daemon.run(ended_after_a_while())

    result = CliRunner().invoke(main, [f"--connect=127.0.0.1:{daemon.port}", "record"], obj=interrupted)
    assert result.exit_code == 0, result.output
    began_s, ended_s = times_of(daemon, "start_recording", "stop_recording")
    assert ended_s - began_s == pytest.approx(3.0, abs=0.2)
    assert "Recorded 12.5 s" in result.output


def test_a_recording_that_the_disk_ends_is_an_error(daemon: FakeDaemon, control: Control) -> None:
    """The reason is told, and the exit code says that it failed."""
    daemon.recording = {"state": "failed", "reason": "evening_1.mcap has ended: the disk is full"}
    result = control("record", "--for", "10s")
    assert result.exit_code == Exit.FAILED
    assert "the disk is full" in result.output


def test_the_last_minutes_are_written_on_request(daemon: FakeDaemon, control: Control) -> None:
    """With a reason, which belongs to the file's name; a time makes no sense there."""
    result = control("record", "--ring", "odd noise")
    assert result.exit_code == 0, result.output
    assert ("save_ring", {"reason": "odd noise"}) in [(m, p) for _, m, p in daemon.calls]
    assert "Wrote the last 118 s: /recordings/ring_asked_1.mcap" in result.output
    assert control("record", "--ring", "--for", "3s").exit_code == Exit.USAGE


def test_recordings_are_listed(daemon: FakeDaemon, control: Control) -> None:
    """With what is wrong with each; scripts read JSON."""
    row = {
        "file": "a_1.mcap",
        "size_bytes": 4_000,
        "changed_at_s": 1.7e9,
        "complete": False,
        "recording": False,
    }
    daemon.recordings = [row]
    told = control("log", "list").output
    assert "a_1.mcap" in told
    assert "4.0 kB" in told
    assert "was cut" in told


def test_recordings_are_listed_for_scripts(control: Control) -> None:
    """One object with the folder and every file."""
    assert json.loads(control("log", "list", "--json").output) == {"folder": "/recordings", "files": []}


def test_a_daemon_that_records_nothing_says_what_is_missing(daemon: FakeDaemon, control: Control) -> None:
    """The configuration's key and the extra are in the message."""
    daemon.refuse["start_recording"] = "method_not_found"
    result = control("record")
    assert result.exit_code == Exit.REFUSED
    assert "[recording]" in result.output
    assert "the extra 'recording'" in result.output
