"""What can be said, and what it means."""

import pytest
from chefbot_speech.commands import Action, Command, Vocabulary, spoken
from chefbot_speech.recognition import Heard

from chefbotd.client.models import PlaceData


def place(name: str, kind: str = "table") -> PlaceData:
    """A place somewhere."""
    return PlaceData(name, 1.0, 2.0, 0.0, kind)  # type: ignore[arg-type]


RESTAURANT = Vocabulary.of(
    [
        place("Table 1"),
        place("table-12"),
        place("kitchen", "home"),
        place("charger", "dock"),
        place("hall", "other"),
    ]
)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Table 3", "table three"),
        ("table-21", "table twenty one"),
        ("T40", "t forty"),
        ("room 117", "room one one seven"),
        ("kitchen", "kitchen"),
        ("[a] | stop;", "a stop"),
        ("...", ""),
    ],
)
def test_a_name_is_spoken_in_words_alone(name: str, words: str) -> None:
    """Numbers below 100 as such, others digit by digit; no sign of a grammar is left."""
    assert spoken(name) == words


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("go to table one", Command(Action.GO, "Table 1")),
        ("please bring this to table twelve", Command(Action.GO, "table-12")),
        ("Drive to the kitchen please", Command(Action.GO, "kitchen")),
        ("go home", Command(Action.GO, "kitchen")),
        ("come to charger", Command(Action.GO, "charger")),
        ("stop now", Command(Action.STOP)),
        ("cancel", Command(Action.CANCEL)),
        ("yes", Command(Action.YES)),
        ("no", Command(Action.NO)),
    ],
)
def test_a_phrase_means_a_place_or_a_word(said: str, meant: Command) -> None:
    """With or without what is only polite."""
    assert RESTAURANT.meaning(said) == meant


@pytest.mark.parametrize(
    "said", ["", "go to", "table one", "go to the hall", "go to table one two", "please"]
)
def test_half_a_phrase_and_other_places_mean_nothing(said: str) -> None:
    """Also a place of another kind."""
    assert RESTAURANT.meaning(said) is None


def test_places_that_sound_alike_or_cannot_be_said_are_left_out_by_name() -> None:
    """Both of a pair; and what the recognizer has no word for."""
    places = [
        place("table 2"),
        place("Table-2"),
        place("table 3"),
        place("Plötz", "home"),
        place("!", "dock"),
    ]
    known = {"table", "two", "three", "home"}
    vocabulary = Vocabulary.of(places, known)
    assert vocabulary.left_out == ("table 2", "Table-2", "Plötz", "!")
    assert vocabulary.meaning("go to table two") is None
    assert vocabulary.meaning("go home") is None
    assert vocabulary.meaning("go to table three") == Command(Action.GO, "table 3")


def test_home_is_a_word_only_where_there_is_one() -> None:
    """Of two homes neither is meant."""
    vocabulary = Vocabulary.of([place("kitchen", "home"), place("bar", "home")])
    assert vocabulary.meaning("go home") is None
    assert "home" not in vocabulary.grammar(confirming=False)


def test_yes_is_in_the_grammar_only_where_the_robot_has_asked() -> None:
    """So nothing is taken for a yes that answers no question."""
    words = {confirming: RESTAURANT.grammar(confirming=confirming) for confirming in (False, True)}
    assert "yes" not in words[False]
    assert "yes" in words[True]
    assert all("table twelve" in grammar and "hall" not in grammar for grammar in words.values())


@pytest.mark.parametrize(
    ("heard", "understood"),
    [
        (Heard("go to table one", 0.1), Command(Action.GO, "Table 1")),
        (Heard("go to table one", -0.1), None),
        (Heard("go to table one", 1.0, ("go to table twelve",)), None),
        (Heard("go to table one", 1.0, ("come to table one", "go to")), Command(Action.GO, "Table 1")),
        (Heard("stop", 1.0, ("go home",)), None),
    ],
)
def test_what_is_unlikely_or_has_a_rival_of_another_meaning_is_not_understood(
    heard: Heard, understood: Command | None
) -> None:
    """A rival that means the same, or nothing, is none."""
    assert RESTAURANT.understood(heard) == understood
