"""What can be said to the robot: places and a few words, as a grammar, and what a recognized phrase means.

There are no velocities: the only motion that can be asked for is a goal at a place.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final, Self

from chefbot_speech.recognition import Heard
from chefbotd.client.models import PlaceData

KINDS: Final = ("table", "dock", "home")
"""The kinds of places that can be asked for."""

POLITE: Final = {"please", "now"}
VERBS: Final = ("go to", "drive to", "come to", "bring this to")
HOME: Final = ("go home", "drive home")
UNITS: Final = (
    *(
        "zero",
        "one",
        "two",
        "three",
        "four",
        "five",
        "six",
        "seven",
        "eight",
        "nine",
        "ten",
        "eleven",
        "twelve",
    ),
    *("thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen"),
)
TENS: Final = ("", "", "twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety")


class Action(StrEnum):
    """What a phrase asks for."""

    GO = "go"
    STOP = "stop"
    CANCEL = "cancel"
    YES = "yes"
    NO = "no"


@dataclass(frozen=True, slots=True)
class Command:
    """What was asked for; ``place`` is the name of the place to go to."""

    action: Action
    place: str = ""


WORDS: Final[Mapping[str, Action]] = {
    "stop": Action.STOP,
    "cancel": Action.CANCEL,
    "yes": Action.YES,
    "yes go": Action.YES,
    "no": Action.NO,
}
CONFIRMING: Final = {Action.YES, Action.NO}
"""They are listened for only while the robot has asked."""


def spoken(name: str) -> str:
    """The words of a name, as they are said: ``Table-12`` is ``table twelve``."""
    parts = re.findall(r"\d+|[^\W\d_]+", name.lower())
    return " ".join(_number(part) if part.isdecimal() else part for part in parts)


def _number(digits: str) -> str:
    value = int(digits)
    if value < len(UNITS):
        return UNITS[value]
    if value < 100:
        ten, unit = divmod(value, 10)
        return TENS[ten] + (f" {UNITS[unit]}" if unit else "")
    return " ".join(UNITS[int(digit)] for digit in digits)


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """``goals``: the place's name by what follows "go to"; ``home``: where "go home" goes, if anywhere.

    ``left_out`` are places that sound like another, or that the recognizer has no words for.
    """

    goals: Mapping[str, str] = field(default_factory=dict)
    home: str = ""
    left_out: tuple[str, ...] = ()

    @classmethod
    def of(cls, places: Iterable[PlaceData], can_say: Iterable[str] | None = None) -> Self:
        """``can_say``: the words that the recognizer knows; None: all."""
        known = None if can_say is None else set(can_say)
        named = [(spoken(place.name), place) for place in places if place.kind in KINDS]
        said = [words for words, _ in named]
        usable = {
            words: place
            for words, place in named
            if words and said.count(words) == 1 and (known is None or known >= set(words.split()))
        }
        goals = {
            f"{the}{words}": place.name
            for words, place in usable.items()
            for the in (("the ", "") if place.kind != "table" else ("",))
        }
        homes = [place.name for place in usable.values() if place.kind == "home"]
        return cls(
            goals,
            homes[0] if len(homes) == 1 else "",
            tuple(place.name for words, place in named if words not in usable),
        )

    def meaning(self, text: str) -> Command | None:
        """What a phrase means; None: nothing, such as half a phrase."""
        said = " ".join(word for word in text.lower().split() if word not in POLITE)
        if said in WORDS:
            return Command(WORDS[said])
        if said in HOME and self.home:
            return Command(Action.GO, self.home)
        for verb in VERBS:
            if said.startswith(f"{verb} ") and (place := self.goals.get(said.removeprefix(f"{verb} "))):
                return Command(Action.GO, place)
        return None

    def understood(self, heard: Heard) -> Command | None:
        """What was said; None: it is not certain, or a rival means something else."""
        command = self.meaning(heard.text) if heard.is_certain else None
        others = {self.meaning(rival) for rival in heard.rivals} - {command, None}
        return None if others else command

    def grammar(self, *, confirming: bool) -> str:
        """In JSGF (JSpeech Grammar Format, W3C note of 2000). Yes and no are in it only where the robot has asked."""
        phrases = [word for word, action in WORDS.items() if confirming or action not in CONFIRMING]
        if self.goals:
            phrases.append(f"({' | '.join(VERBS)}) ({' | '.join(self.goals)})")
        if self.home:
            phrases.extend(HOME)
        return (
            "#JSGF V1.0;\ngrammar robot;\n"
            f"public <command> = [please] ({' | '.join(phrases)}) [please | now];\n"
        )
