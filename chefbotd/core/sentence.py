"""A sentence for people that can be said in another language: its English words, with an id and its arguments."""

from collections.abc import Iterable, Mapping, Sequence
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


def join_words(words: Sequence[str]) -> str:
    """Some words or sentences, at least one, as "A and B and C"; the "and" can be said in another language."""
    first, *others = words
    for other in others:
        first = Sentence("driving.and", "{first} and {other}", first=first, other=other)
    return first


def join_sentences(sentences: Iterable[str]) -> str:
    """Those that are not empty, as "A; B"; empty without any."""
    joined = ""
    for sentence in filter(None, sentences):
        joined = (
            Sentence("driving.both", "{first}; {other}", first=joined, other=sentence) if joined else sentence
        )
    return joined


SAID = "said"
"""The member of an object that says of which sentences some of its texts are, by the texts' names."""

_MARK = "\0sentence"


def plain_words(value: object) -> str:
    """For the encoders of msgspec, which take no class of text but ``str``: a sentence's English words alone."""
    if isinstance(value, Sentence):
        return str(value)
    raise NotImplementedError(f"{type(value).__name__} cannot be encoded")


def mark_sentence(sentence: Sentence) -> dict[str, Any]:
    """For ``with_ids``: what stands in the place of a sentence among dicts, lists, text and numbers."""
    return {_MARK: str(sentence), **sentence_data(sentence)}


def with_ids(value: Any) -> Any:
    """The same with each marked sentence as its words, and with its id and its arguments in ``said`` beside it.

    Of a list with sentences ``said`` has a list, with null for what is none.
    """
    if isinstance(value, list):
        return [with_ids(item) for item in value]
    if not isinstance(value, dict):
        return value
    if _MARK in value:
        return value[_MARK]
    said = {name: data for name, item in value.items() if (data := _said_of(item))}
    return {name: with_ids(item) for name, item in value.items()} | ({SAID: said} if said else {})


def _said_of(item: Any) -> Any:
    if isinstance(item, dict) and _MARK in item:
        return {"id": item["id"], "arguments": item["arguments"]}
    if isinstance(item, list) and any(isinstance(part, dict) and _MARK in part for part in item):
        return [_said_of(part) for part in item]
    return None


def with_sentences(value: Any) -> Any:
    """What ``with_ids`` has made, with sentences again in the place of their words."""
    if isinstance(value, list):
        return [with_sentences(item) for item in value]
    if not isinstance(value, dict):
        return value
    said = value.get(SAID)
    whole = {name: with_sentences(item) for name, item in value.items() if name != SAID or not said}
    return whole | {name: _with_said(whole[name], data) for name, data in (said or {}).items()}


def _with_said(words: Any, data: Any) -> Any:
    if isinstance(data, list):
        return [_with_said(part, own) for part, own in zip(words, data, strict=True)]
    return sentence_of(words, data) if data else words
