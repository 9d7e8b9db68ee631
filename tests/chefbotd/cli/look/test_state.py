"""``status --watch``: the state again and again, also over a connection that is lost."""

import asyncio
from collections.abc import Mapping
from typing import Any

import pytest
from rich.console import Console

from chefbotd.cli.look.commands import follow
from chefbotd.cli.look.view import draw_state
from chefbotd.client import Client, ConnectionLost
from tests.chefbotd.cli.fake_daemon import FakeDaemon
from tests.chefbotd.conftest import Control

Shown = list[tuple[Mapping[str, Any] | None, str]]


def test_it_is_shown_twice_a_second(daemon: FakeDaemon) -> None:
    """In 1.6 s at 0, 0.5, 1 and 1.5 s: four times, with the counters and without a complaint."""
    shown: Shown = []

    async def watch() -> None:
        async with Client.connect("127.0.0.1", daemon.port) as robot:
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(follow(robot, lambda *each: shown.append(each)), 1.6)

    daemon.run(watch())
    assert [trouble for _, trouble in shown] == [""] * 4
    assert all(state is not None and state["stats"]["lines_out"] == 50 for state, _ in shown)


def test_without_an_answer_the_last_state_stays_with_the_reason(daemon: FakeDaemon) -> None:
    """The daemon answers once and is gone then."""
    shown: Shown = []

    class Losing:
        def __init__(self, robot: Client) -> None:
            self._robot, self.hello, self.asked = robot, robot.hello, 0

        async def call(self, method: str) -> Any:
            self.asked += 1
            if self.asked > 2:
                raise ConnectionLost("the daemon hung up")
            return await self._robot.call(method)

    async def watch() -> None:
        async with Client.connect("127.0.0.1", daemon.port) as robot:
            losing: Any = Losing(robot)
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(follow(losing, lambda *each: shown.append(each)), 0.6)

    daemon.run(watch())
    assert [trouble for _, trouble in shown] == ["", "no answer: the daemon hung up"]
    assert shown[0][0] == shown[1][0] is not None
    console = Console(width=100)
    with console.capture() as captured:
        console.print(draw_state(*shown[1]))
    assert "no answer: the daemon hung up" in captured.get()
    assert "armed, nobody drives" in captured.get()


def test_it_needs_a_terminal_to_draw_on(control: Control) -> None:
    """A file would get a table a second: --json is for that."""
    result = control("status", "--watch")
    assert result.exit_code == 2
    assert "this needs a terminal" in result.stderr


def test_watch_picks_fields(control: Control) -> None:
    """One number of a list, and nothing else of the topic."""
    line = control("watch", "wheels.duty.0", "--count", "1").stdout.strip()
    assert line.endswith(" wheels duty.0=1")


def test_watch_refuses_a_field_that_is_not_there(control: Control) -> None:
    """With the exit code of wrong arguments."""
    wrong = control("watch", "wheels.dutty", "--count", "1")
    assert wrong.exit_code == 2
    assert "wheels has no field 'dutty'" in wrong.stderr
