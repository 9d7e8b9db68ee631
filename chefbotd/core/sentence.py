"""A sentence for people that can be said in another language: its English words, with an id and its arguments."""

from collections.abc import Mapping
from typing import Any, TypeAlias

Value: TypeAlias = str | int | float | dict[str, Any]


class Sentence(str):
    """The English words; ``sentence_id`` and ``arguments`` are what a catalogue of another language needs.

    docs/reference/refusals.md lists the patterns by their ids, with the arguments' names in braces.
    """

    sentence_id: str
    arguments: Mapping[str, Value]

    def __new__(cls, sentence_id: str, pattern: str, **arguments: object) -> "Sentence":
        """Made of a pattern as ``str.format`` knows it; the id begins with the component's name."""
        return cls.of(pattern.format(**arguments), sentence_id, arguments)

    @classmethod
    def of(cls, words: str, sentence_id: str, arguments: Mapping[str, object]) -> "Sentence":
        """Of English words that are there already."""
        sentence = super().__new__(cls, words)
        sentence.sentence_id = sentence_id
        sentence.arguments = {name: _value(argument) for name, argument in arguments.items()}
        return sentence

    def __reduce__(self) -> tuple[Any, ...]:
        return Sentence.of, (str(self), self.sentence_id, dict(self.arguments))


def _value(argument: object) -> Value:
    """An argument as JSON can have it; a sentence, or a refusal's, has its id, its arguments and its ``message``."""
    words = getattr(argument, "words", argument)
    if isinstance(words, Sentence):
        return {"message": str(words), **sentence_data(words)}
    return words if isinstance(words, str | int | float | dict) else str(words)


def sentence_data(words: str) -> dict[str, Any]:
    """What an error or a message says beside its words: ``id`` and ``arguments``; nothing for words without an id."""
    if not isinstance(words, Sentence):
        return {}
    return {"id": words.sentence_id, "arguments": dict(words.arguments)}


def sentence_of(words: str, data: Mapping[str, Any]) -> str:
    """The words that came with this ``data``, as the sentence that they were; without an id as they are."""
    return Sentence.of(words, data["id"], data.get("arguments", {})) if "id" in data else words
