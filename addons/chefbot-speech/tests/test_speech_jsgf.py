"""Phrases of a grammar, counted by hand."""

import pytest
from chefbot_speech.commands import Vocabulary
from chefbot_speech.jsgf import phrases

from chefbotd.client.models import PlaceData

HEAD = "#JSGF V1.0;\ngrammar robot;\n"


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ("stop", ("stop",)),
        ("go home | stop", ("go home", "stop")),
        ("[please] stop", ("please stop", "stop")),
        ("go to (table one | dock)", ("go to table one", "go to dock")),
        ("(a | b) [c | d]", ("a c", "a d", "a", "b c", "b d", "b")),
        ("[a]", ("a",)),
        ("a | (b [a])| a", ("a", "b a", "b")),
    ],
)
def test_every_phrase_is_there_once(rule: str, expected: tuple[str, ...]) -> None:
    """In the grammar's order; nothing at all is no phrase."""
    assert phrases(f"{HEAD}public <command> = {rule};\n") == expected


@pytest.mark.parametrize(
    "rule", ["go to <place>", "go (home", "go home)", "go [home)", "stop*", "/2/ stop | go", "a {b}"]
)
def test_what_it_does_not_read_is_refused(rule: str) -> None:
    """Other rules, weights, tags, repetitions, and brackets that do not match."""
    with pytest.raises(ValueError, match="in a grammar"):
        phrases(f"{HEAD}public <command> = {rule};\n")


def test_a_text_without_a_rule_is_refused() -> None:
    """The message has the text."""
    with pytest.raises(ValueError, match="one public rule, got 'stop'"):
        phrases("stop")


def test_each_phrase_of_the_robots_grammar_has_a_meaning() -> None:
    """4 verbs to 3 names, 2 ways home, stop, cancel: 16, times 2 and 3 for please and now."""
    places = [
        PlaceData("table 1", 0.0, 0.0, 0.0, "table"),  # type: ignore[arg-type]
        PlaceData("dock", 0.0, 0.0, 0.0, "home"),  # type: ignore[arg-type]
    ]
    vocabulary = Vocabulary.of(places)
    found = phrases(vocabulary.grammar(confirming=False))
    assert len(found) == 16 * 2 * 3
    assert all(vocabulary.meaning(phrase) for phrase in found)
