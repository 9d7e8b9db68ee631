"""The tokens of Whisper's English models: byte pairs (Sennrich et al. 2016) of GPT-2's vocabulary."""

import itertools
import json
import re
from collections.abc import Iterable
from pathlib import Path

from chefbot_speech.commands import spoken

END, START, PREVIOUS, NO_TIMES = 50_256, 50_257, 50_360, 50_362
"""End of text, start of a transcript, what was said before it, and no time stamps."""

_PIECE = re.compile(r" ?[A-Za-z]+| ?\d+| ?[^\sA-Za-z\d]+")
_MOST_NUMBER = 99


class Tokenizer:
    """Text to numbers, and back."""

    def __init__(self, file: Path) -> None:
        """``file`` is ``tokenizer.json`` beside the model; raises ``OSError`` or ``ValueError``."""
        model = json.loads(file.read_text(encoding="utf-8"))["model"]
        self._number: dict[str, int] = model["vocab"]
        pairs = (pair.split(" ") if isinstance(pair, str) else pair for pair in model["merges"])
        self._rank = {(first, second): rank for rank, (first, second) in enumerate(pairs)}
        self._letters = {number: letters for letters, number in self._number.items()}
        self._letter = _printable()
        self._byte = {letter: byte for byte, letter in self._letter.items()}

    def encode(self, text: str) -> list[int]:
        """Words in it are told from others by a space before each, as in running text."""
        return [self._number[letters] for piece in _PIECE.findall(text) for letters in self._pairs(piece)]

    def decode(self, numbers: Iterable[int]) -> str:
        """What is no text is left out."""
        letters = "".join(self._letters.get(number, "") for number in numbers if number < END)
        return bytes(self._byte[letter] for letter in letters).decode(errors="replace")

    def _pairs(self, piece: str) -> list[str]:
        """The pair that was learned first is joined first."""
        parts = [self._letter[byte] for byte in piece.encode()]
        while len(parts) > 1:
            ranks = [self._rank.get(pair, len(self._rank)) for pair in itertools.pairwise(parts)]
            first = ranks.index(min(ranks))
            if ranks[first] == len(self._rank):
                break
            parts[first : first + 2] = ["".join(parts[first : first + 2])]
        return parts


def _printable() -> dict[int, str]:
    """GPT-2's letter for each byte: its own where that can be printed, else one from beyond 255."""
    own = [byte for byte in range(256) if chr(byte).isprintable() and chr(byte) != " "]
    others = [byte for byte in range(256) if byte not in own]
    return {byte: chr(byte) for byte in own} | {byte: chr(256 + index) for index, byte in enumerate(others)}


def written(phrase: str) -> str:
    """As Whisper writes it: ``go to table three`` is `` Go to table 3.``."""
    words = phrase
    for number in range(_MOST_NUMBER, -1, -1):  # twenty-one before twenty
        words = re.sub(rf"\b{spoken(str(number))}\b", str(number), words)
    return f" {words[:1].upper()}{words[1:]}."
