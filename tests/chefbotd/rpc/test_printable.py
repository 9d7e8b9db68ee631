"""Texts of clients that a terminal would take for commands."""

import json
from typing import Any

import pytest
from structlog.testing import capture_logs

from chefbotd.clock import run_virtual
from tests.fakes.api import LineClient, line_client, serving

TITLE = "\x1b]0;all is well\x07"


def with_client(scenario: Any) -> None:
    """Run a scenario with a served fake robot and one client."""

    async def main() -> None:
        async with serving() as served, line_client(served) as client:
            await scenario(served, client)

    with capture_logs():
        run_virtual(main())


@pytest.mark.parametrize("text", [TITLE, "\x9b2J", "\u202eevil", "two\nlines", "\x7f"])
@pytest.mark.parametrize(
    ("method", "params"),
    [
        ("set_client_name", {"client": "{}"}),
        ("take_control", {"source": "{}"}),
        ("subscribe", {"topics": ["{}"]}),
        ("get_pid", {"{}": 1}),
    ],
)
def test_no_text_of_a_client_holds_any(method: str, params: dict[str, object], text: str) -> None:
    """Whatever the method, in a value, in a list or as a name: refused, and the answer repeats none either."""
    filled = json.loads(json.dumps(params).replace("{}", json.dumps(text)[1:-1]))

    async def scenario(served: Any, client: LineClient) -> None:
        answer = await client.ask(method, **filled)
        assert answer["error"]["data"]["kind"] == "invalid_params"
        assert answer["error"]["message"].isprintable()
        assert served.robot.calls == []

    with_client(scenario)


def test_a_stop_with_such_a_reason_is_carried_out_and_its_reason_is_printable() -> None:
    """A robot that drives on because of a reason's letters would have understood and not obeyed."""

    async def scenario(served: Any, client: LineClient) -> None:
        assert "result" in await client.ask("estop", reason=f"{TITLE}smoke\u202e")
        assert served.robot.calls == [("estop", "\ufffd]0;all is well\ufffdsmoke\ufffd")]

    with_client(scenario)
