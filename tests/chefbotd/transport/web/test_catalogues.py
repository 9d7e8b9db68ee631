"""The catalogues of the page and of our cards: complete in each language, and each sentence is one that is said."""

import json
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest

from chefbotd.component_list import own_components
from chefbotd.composition.network import cards_of
from chefbotd.transport.web import server
from tests.sentences import patterns

PAGE = Path(server.__file__).parent / "page"
FOLDERS = [PAGE] + [
    card.file.parent
    for card in cards_of((component.name, part) for component in own_components() for part in component.page)
]
PLURALS = {
    "en": {"one", "other"},
    "de": {"one", "other"},
    "es": {"one", "many", "other"},
    "ar": {"zero", "one", "two", "few", "many", "other"},
}
"""The plural forms of whole numbers, of the Unicode CLDR's rules for cardinals."""
ID = re.compile(r'["=]([a-z_]+\.[a-z_]+(?:\.[a-z_]+)*)"')
PREFIX = re.compile(r"`([a-z_]+\.[a-z_.]*)\$\{|named\(\"([a-z.]+)\"")
NOT_FOR_READERS = {"language.name", "language.direction"}


def catalogue(folder: Path, language: str) -> dict[str, str | dict[str, str]]:
    """The words of a folder in a language; a key that stands twice is an error."""

    def unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
        assert len(dict(pairs)) == len(pairs)
        return dict(pairs)

    text = (folder / "languages" / f"{language}.json").read_text(encoding="utf-8")
    words: dict[str, str | dict[str, str]] = json.loads(text, object_pairs_hook=unique)
    return words


def of_page(words: dict[str, str | dict[str, str]]) -> dict[str, str | dict[str, str]]:
    """The page's own sentences: those of the daemon are English already, and stand in its code."""
    return {key: sentence for key, sentence in words.items() if not key.startswith("refusal.")}


def placeholders(words: str | dict[str, str]) -> set[str]:
    """The arguments that a sentence has a place for."""
    return set(re.findall(r"\{(\w+)\}", words if isinstance(words, str) else words["other"]))


def scripts(folder: Path) -> str:
    """What the modules of a folder say, and the page's HTML."""
    files = [*folder.glob("*.js"), *folder.glob("*.html")]
    return "\n".join(file.read_text(encoding="utf-8") for file in files)


@pytest.mark.parametrize("language", sorted(PLURALS.keys() - {"en"}))
@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: str(folder.relative_to(PAGE.parents[2])))
def test_each_language_is_complete(folder: Path, language: str) -> None:
    """Each sentence is there, with the same arguments, its keys to press, and the plural forms of its language."""
    english, words = catalogue(folder, "en"), of_page(catalogue(folder, language))
    assert words.keys() == english.keys()
    for key, sentence in words.items():
        assert placeholders(sentence) == placeholders(english[key]), key
        assert isinstance(sentence, dict) == isinstance(english[key], dict), key
        if isinstance(sentence, dict):
            assert sentence.keys() == PLURALS[language], key
            for form in sentence.values():  # "one" may say the number in a word
                assert placeholders(sentence) - {"count"} <= placeholders(form) <= placeholders(sentence), key
        else:
            assert sentence.strip() == sentence != "", key
            assert sentence.count("`") == str(english[key]).count("`"), key


def test_our_languages_are_those_that_are_tried_here() -> None:
    """No file of another language lies in any of the folders."""
    for folder in FOLDERS:
        assert {file.stem for file in (folder / "languages").glob("*")} == PLURALS.keys(), folder


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: str(folder.relative_to(PAGE.parents[2])))
def test_each_sentence_that_is_said_is_in_the_catalogue_and_each_of_it_is_said(folder: Path) -> None:
    """By its id, or by the beginning of its id and a state of the daemon."""
    english = catalogue(folder, "en")
    text = scripts(folder)
    prefixes = tuple(first or f"{second}." for first, second in PREFIX.findall(text))
    said = set(ID.findall(text)) - {group for _, group in PREFIX.findall(text)}
    known = english.keys() | catalogue(PAGE, "en").keys()
    groups = {key.split(".")[0] for key in known}
    unknown = {key for key in said if key.split(".")[0] in groups and key not in known}
    assert {key for key in unknown if not key.endswith((".js", ".json"))} == set()
    silent = {key for key in english if key not in said and not key.startswith(prefixes)} - NOT_FOR_READERS
    assert silent == set()


def refusals(language: str) -> dict[str, str | dict[str, str]]:
    """The daemon's sentences by their ids as a language says them, of every folder."""
    told: dict[str, str | dict[str, str]] = {}
    for folder in FOLDERS:
        words = catalogue(folder, language)
        told.update(
            {key.removeprefix("refusal."): words[key] for key in words.keys() - of_page(words).keys()}
        )
    return told


@pytest.mark.parametrize("language", sorted(PLURALS.keys() - {"en"}))
def test_each_language_has_words_for_each_sentence_of_the_daemon(language: str) -> None:
    """And for none that the daemon does not say."""
    assert refusals(language).keys() == dict(patterns()).keys()


@pytest.mark.parametrize("language", sorted(PLURALS.keys() - {"en"}))
def test_a_refusal_of_the_daemon_says_the_same_in_each_language(language: str) -> None:
    """With the arguments of its English sentence."""
    english = {key: set(re.findall(r"\{(\w+)", pattern)) for key, pattern in patterns()}
    for key, sentence in refusals(language).items():
        assert placeholders(sentence) == english[key], key


class Texts(HTMLParser):
    """The texts of the page's HTML, each with the id that its element has for it."""

    VOID = frozenset({"meta", "link", "input", "path", "br"})
    LEFT = frozenset({"kbd"})

    def __init__(self) -> None:
        super().__init__()
        self._open: list[tuple[str, str | None]] = []
        self.by_id: dict[str, str] = {}
        self.without: list[str] = []
        self.labels: list[tuple[str, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """An element with its id; a key to press belongs to the sentence around it."""
        own = dict(attrs)
        for name in ("aria-label", "title", "placeholder"):
            if own.get(name):
                self.labels.append((str(own[name]), own.get(f"data-t-{name}")))
        if tag in self.VOID:
            return
        outer = self._open[-1][1] if self._open and tag in self.LEFT else None
        self._open.append((tag, own.get("data-t", outer)))
        if tag in self.LEFT and outer:
            self.by_id[outer] += "`"

    def handle_endtag(self, tag: str) -> None:
        """The end of an element."""
        _, key = self._open.pop() if tag not in self.VOID else ("", None)
        if tag in self.LEFT and key:
            self.by_id[key] += "`"

    def handle_data(self, data: str) -> None:
        """A text, of the sentence of its element."""
        tag, key = self._open[-1] if self._open else ("", None)
        if key:
            self.by_id[key] = self.by_id.get(key, "") + data
        elif data.strip() and tag not in ("title", "script"):
            self.without.append(data.strip())


def texts_of_page() -> Texts:
    """What the page's HTML says."""
    texts = Texts()
    texts.feed((PAGE / "index.html").read_text(encoding="utf-8"))
    return texts


def untranslated() -> Iterator[str]:
    """Texts and labels of the page without an id that have a word in them."""
    texts = texts_of_page()
    figures = {"0.20 m/s", "0.8 rad/s", "rad/s", "kp", "ki", "kd"}
    yield from (text for text in texts.without if re.search(r"\w", text) and text not in figures)
    yield from (text for text, key in texts.labels if key is None)


def test_what_shows_before_any_script_is_the_catalogues_english() -> None:
    """The page's HTML has the English words themselves, so that the stops read right at once."""
    english = catalogue(PAGE, "en")
    texts = texts_of_page()
    assert texts.by_id
    for key, text in texts.by_id.items():
        assert re.sub(r"\s+", " ", text).strip() == english[key], key
    for text, key in texts.labels:
        assert english[str(key)] == text


def test_no_text_of_the_page_is_left_out() -> None:
    """Each word of its HTML has an id, but for the names of units and gains."""
    assert list(untranslated()) == []
