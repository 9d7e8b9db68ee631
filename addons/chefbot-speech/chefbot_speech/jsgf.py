"""The phrases of a grammar in JSGF (JSpeech Grammar Format, W3C note of 2000), for recognizers that take a list.

Read are sequences, alternatives ``a | b``, groups ``(a)`` and what may be left out ``[a]``, in one public rule: all
that ``chefbot_speech.commands`` writes. There are no other rules, weights, tags or repetitions.
"""

import re
from collections.abc import Iterator

_RULE = re.compile(r"public\s+<\w+>\s*=([^;]*);")
_PART = re.compile(r"[()\[\]|]|[^\s()\[\]|]+")
_OTHER = re.compile(r"[<>{}/*+]")
_CLOSING = {"(": ")", "[": "]"}


def phrases(grammar: str) -> tuple[str, ...]:
    """All of them, each once, in the order of the grammar. Raises ``ValueError`` where it has something else."""
    rule = _RULE.search(grammar)
    if rule is None:
        raise ValueError(f"expected a grammar with one public rule, got {grammar!a}")
    found = _alternatives(iter(_PART.findall(rule[1])), "")
    return tuple(dict.fromkeys(" ".join(words) for words in found if words))


def _alternatives(parts: Iterator[str], end: str) -> list[tuple[str, ...]]:
    """What may be said from here to the bracket that ends it; ``""``: to the end."""
    finished: list[tuple[str, ...]] = []
    heads: list[tuple[str, ...]] = [()]
    for part in parts:
        if part == end:
            return finished + heads
        if part == "|":
            finished, heads = finished + heads, [()]
        elif part in _CLOSING:
            tails = _alternatives(parts, _CLOSING[part]) + ([()] if part == "[" else [])
            heads = [head + tail for head in heads for tail in tails]
        elif part in _CLOSING.values() or _OTHER.search(part):
            raise ValueError(f"expected words, groups and alternatives in a grammar, got {part!a}")
        else:
            heads = [(*head, part) for head in heads]
    if end:
        raise ValueError(f"expected {end} in a grammar, and it has ended")
    return finished + heads
