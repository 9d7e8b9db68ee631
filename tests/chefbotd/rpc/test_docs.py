"""docs/api.md says what the daemon says of itself."""

import re
from pathlib import Path

import pytest

from chefbotd.rpc import jsonrpc
from chefbotd.rpc.jsonrpc import ERRORS, Request
from chefbotd.rpc.methods import NOTIFICATIONS
from chefbotd.rpc.parameters import ApiParameters
from tests.chefbotd.client.api_page import members
from tests.fakes.robot import methods_of_socket, topics_of

PAGE = Path(__file__).parents[3] / "docs" / "api.md"
pytestmark = pytest.mark.skipif(
    not PAGE.exists(), reason="the documentation is not part of an installed package"
)

TOPICS, METHODS = topics_of(simulated=True), methods_of_socket()


def rows(heading: str) -> dict[str, str]:
    """The table under a heading: the name in the first column, and the whole row."""
    section = PAGE.read_text(encoding="utf-8").split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return dict(re.findall(r"^\| `(\w+)` (\|.*)$", section, re.MULTILINE))


def test_every_method_has_a_row_with_its_parameters() -> None:
    """The table of methods is complete, and so are their parameters, but for the many gains."""
    table = rows("Methods")
    assert table.keys() == METHODS.keys()
    for name, method in METHODS.items():
        for parameter in list(method.params.model_fields)[:4]:
            assert f"`{parameter}`" in table[name], (name, parameter)


def test_every_topic_has_a_row_with_its_fields() -> None:
    """The table of topics is complete; ``stats`` alone is not spelt out."""
    table = rows("Topics")
    assert table.keys() == TOPICS.keys()
    for name, topic in TOPICS.items():
        for field in members(topic.model) if name != "stats" else ():
            assert f"`{field}`" in table[name], (name, field)


def test_every_error_has_its_row() -> None:
    """Kinds, codes and meanings are those of the table that errors are made from."""
    expected = {str(kind): f"| {error.code} | {error.meaning} |" for kind, error in ERRORS.items()}
    assert rows("Errors") == expected


def test_notifications_and_limits_are_those_in_force() -> None:
    """Each notification is shown; each number that is promised is the default."""
    text, limits = PAGE.read_text(encoding="utf-8"), ApiParameters()
    for name in NOTIFICATIONS:
        assert f'"method":"{name}"' in text
    assert f"{limits.max_request_bytes} bytes (`max_request_bytes`)" in text
    assert f"{limits.outbox_bytes // 1024} KiB (`outbox_bytes`)" in text
    assert f"{limits.write_timeout_s:g} s (`write_timeout_s`)" in text
    assert f"{limits.backlog_bytes // 1024} KiB (`backlog_bytes`)" in text
    assert f"{limits.requests_per_turn} (`requests_per_turn`)" in text
    assert f"(`write_buffer_bytes`, {limits.write_buffer_bytes // 1024} KiB)" in text
    assert f"{limits.max_clients} clients (`max_clients`)" in text
    assert f"{limits.reserved_stop_connections} more places (`reserved_stop_connections`)" in text
    assert f"{limits.host}:{limits.port}" in text
    assert f"nesting ends at {jsonrpc.MAX_DEPTH}" in text


def test_every_example_is_a_valid_request() -> None:
    """What the page shows can be pasted into ``nc``, and every method is shown."""
    shown = set()
    for line in re.findall(r'\{"jsonrpc":"2\.0","id":\d+,"method".*\}', PAGE.read_text(encoding="utf-8")):
        request = jsonrpc.parse(line.encode())
        assert isinstance(request, Request), line
        METHODS[request.method].params.model_validate(request.params)
        shown.add(request.method)
    assert shown == METHODS.keys()
