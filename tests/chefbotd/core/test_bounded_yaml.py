"""YAML that somebody else wrote, read by both parsers."""

from typing import Any

import pytest

from chefbotd.core import bounded_yaml
from chefbotd.core.bounded_yaml import LOADER, PlainLoader, load_first_document

READ = [
    ("", None),
    ("a: [1, 2.5, .nan, -.inf, true, null, text]\n", ["a"]),
    ("# c\n- {name: 'é 😀', n: 0x1F}\n---\nsecond: 1\n", [{"name": "é 😀", "n": 31}]),
    ("\ufeffa: 1\n", {"a": 1}),
]


@pytest.fixture(params=[LOADER, PlainLoader], ids=["libyaml", "plain"])
def loader(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each parser in its turn."""
    monkeypatch.setattr(bounded_yaml, "LOADER", request.param)


@pytest.mark.usefixtures("loader")
@pytest.mark.parametrize(("text", "expected"), READ)
def test_the_first_document_is_read(text: str, expected: Any) -> None:
    """Numbers, text of any script, nothing at all; what follows the first document is not looked at."""
    read = load_first_document(text)
    assert (list(read) if isinstance(read, dict) and isinstance(expected, list) else read) == expected


@pytest.mark.usefixtures("loader")
@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("a: &one [1]\nb: *one\n", "aliases"),
        ("[" * 100_000, "nested too deep"),
        ("- " * 100_000, "nested too deep"),
        ("a: [1\n", "not valid YAML"),
        ("a: \x00", "not valid YAML"),
        ("a: !!python/object/apply:os.system [ls]", "not valid YAML"),
        ("\ud800", "."),
    ],
    ids=["alias", "flow", "block", "open", "nul", "code", "surrogate"],
)
def test_what_costs_more_than_its_length_or_is_none_is_refused(text: str, why: str) -> None:
    """Aliases, nesting without end, code, and what is no YAML."""
    with pytest.raises(ValueError, match=why):
        load_first_document(text)
