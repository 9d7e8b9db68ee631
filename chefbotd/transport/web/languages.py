"""The words of the page: one file a language, ``languages/LANGUAGE.json``, in the page's folder and beside each card.

A file has sentences by their ids. English is complete and goes with the page; what another language lacks is English.
"""

import json
from collections.abc import Mapping, Sequence
from hashlib import sha256
from importlib.resources.abc import Traversable

import structlog

log = structlog.get_logger(__name__)

ENGLISH = "en"
FOLDER = "languages"
NAME, DIRECTION = "language.name", "language.direction"
REFUSAL = "refusal."
"""How the ids of refusals begin: the daemon says them in English itself, so the English page has no need of them."""

Words = str | dict[str, str]
"""A sentence, or one for each plural form (``one``, ``other``, ...)."""
Catalogue = dict[str, Words]
"""Sentences by their ids."""


def read_catalogues(folders: Sequence[tuple[str, Traversable]]) -> dict[str, Catalogue]:
    """The catalogues of these owners by their language; the page's own owner is ``""``.

    A component has the ids that begin with its name, or with ``refusal.`` and its name: none can change another's words.
    """
    merged: dict[str, Catalogue] = {}
    for owner, folder in folders:
        languages = folder / FOLDER
        if not languages.is_dir():
            continue
        for entry in sorted(languages.iterdir(), key=lambda file: file.name):
            language, _, suffix = entry.name.rpartition(".")
            if suffix == "json":
                words = merged.setdefault(language, {})
                words |= _words_of(owner, entry) | words
    return {language: words for language, words in merged.items() if NAME in words}


def _words_of(owner: str, file: Traversable) -> Catalogue:
    try:
        words = json.loads(file.read_text(encoding="utf-8"))
        if not isinstance(words, dict):
            raise TypeError(f"a JSON object was expected, got {type(words).__name__}")
    except (OSError, ValueError, TypeError) as error:
        log.error("a language's file is left out", component=owner, file=file.name, reason=str(error))
        return {}
    prefixes = (f"{owner}.", f"refusal.{owner}.")
    foreign = [key for key in words if owner and not key.startswith(prefixes)]
    if foreign:
        log.error("words of others are left out", component=owner, file=file.name, ids=foreign)
    return {key: value for key, value in words.items() if key not in foreign}


def language_files(catalogues: Mapping[str, Catalogue]) -> dict[str, bytes]:
    """What is served: each language's catalogue, and ``english.js`` with the English words and the list of languages."""
    texts = {language: _compact(words) for language, words in catalogues.items()}
    languages = {
        language: {
            "name": words[NAME],
            "direction": words.get(DIRECTION, "ltr"),
            "version": sha256(texts[language].encode()).hexdigest()[:8],
        }
        for language, words in catalogues.items()
    }
    english = _compact(
        {key: words for key, words in catalogues.get(ENGLISH, {}).items() if not key.startswith(REFUSAL)}
    )
    module = f"export const ENGLISH = {english};\nexport const LANGUAGES = {_compact(languages)};\n"
    return {
        "/english.js": module.encode(),
        **{f"/{FOLDER}/{language}.json": text.encode() for language, text in texts.items()},
    }


def _compact(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))
