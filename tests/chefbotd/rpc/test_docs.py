"""docs/api.md says what the daemon says of itself."""

import re
from pathlib import Path

import pytest

from chefbotd.rpc import jsonrpc
from chefbotd.rpc.jsonrpc import ERRORS, Request
from chefbotd.rpc.methods import NOTIFICATIONS
from chefbotd.rpc.parameters import ApiParameters
from tests.chefbotd.client.api_page import inputs_of, is_possible, members
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


def test_every_method_has_an_entry_with_its_parameters_and_its_result() -> None:
    """No method is missing, nor is what it takes and gives, but for the many gains and counters."""
    entries = inputs_of(PAGE.read_text(encoding="utf-8"))
    assert entries.keys() == METHODS.keys()
    for name, method in METHODS.items():
        for parameter in list(method.params.model_fields)[:4]:
            assert f"`{parameter}`" in entries[name].parameters, (name, parameter)
        if not entries[name].result.startswith("as "):
            assert set(members(method.result)) <= set(re.findall(r"`(\w+)`", entries[name].result)), name


def test_every_topic_has_a_row_with_its_fields() -> None:
    """The table of topics is complete; ``stats`` alone is not spelt out."""
    table = rows("Topics")
    assert table.keys() == TOPICS.keys()
    for name, topic in TOPICS.items():
        for field in members(topic.model) if name != "stats" else ():
            assert f"`{field}`" in table[name], (name, field)


def test_every_error_has_its_row() -> None:
    """Kinds, codes and meanings are those of the table that errors are made from."""
    expected = {str(kind): f"| {kind.code} | {kind.meaning} |" for kind in ERRORS}
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


def test_every_method_has_a_worked_request_and_its_answer() -> None:
    """The daemon may answer so, and both have the same number."""
    for name, entry in inputs_of(PAGE.read_text(encoding="utf-8")).items():
        assert entry.examples, name
        for pair in entry.examples:
            assert is_possible(pair, METHODS[name]), pair
            assert pair.request["id"] == pair.answer["id"]


def test_no_two_requests_of_the_page_have_one_number() -> None:
    """A reader who pastes several of them can tell the answers apart."""
    numbers = re.findall(r'\{"jsonrpc":"2\.0","id":(\d+),"method"', PAGE.read_text(encoding="utf-8"))
    assert len(numbers) == len(set(numbers))


def test_no_example_has_a_members_name_for_its_value() -> None:
    """`"text":"text"` is what the writer makes of a new method; put a better example in its place on the page."""
    assert re.findall(r'"(\w+)":\[?"\1"', "\n".join(_examples())) == []


def _examples() -> list[str]:
    return re.findall(r'^\{"jsonrpc".*$', PAGE.read_text(encoding="utf-8"), re.MULTILINE)


def test_words_of_code_are_in_single_backticks() -> None:
    """Doubled ones come from docstrings, and are shown as they stand."""
    assert not re.search(r"(?<!`)``(?!`)", PAGE.read_text(encoding="utf-8"))
