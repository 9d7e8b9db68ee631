"""The languages of the page: merged of the page's own words and those of cards, which cannot change others' words."""

import json
from pathlib import Path

from chefbotd.transport.web.languages import language_files, read_catalogues
from chefbotd.transport.web.server import Card, page_files


def folder_with(folder: Path, **catalogues: object) -> Path:
    """A folder with these catalogues; a text is written as it is."""
    (folder / "languages").mkdir(parents=True)
    for language, words in catalogues.items():
        text = words if isinstance(words, str) else json.dumps(words)
        (folder / "languages" / f"{language}.json").write_text(text)
    return folder


def test_a_component_brings_words_of_its_own_name_only(tmp_path: Path) -> None:
    """Its sentences and its refusals; what it says in the name of the page or of another component is left out."""
    page = folder_with(tmp_path / "page", en={"language.name": "English", "stop": "Stop"})
    ours = {"trip.go": "Go", "refusal.trip.far": "Too far.", "stop": "Drive on", "trips.go": "No"}
    card = folder_with(tmp_path / "trip", en=ours)
    words = read_catalogues([("", page), ("trip", card)])["en"]
    assert words == {
        "language.name": "English",
        "stop": "Stop",
        "trip.go": "Go",
        "refusal.trip.far": "Too far.",
    }


def test_a_broken_file_takes_no_other_words_with_it(tmp_path: Path) -> None:
    """A file that is no JSON, or no object, is left out; so is a language that has no name."""
    page = folder_with(
        tmp_path / "page", en={"language.name": "English"}, de="{", es="[]", fr={"stop": "Halte"}
    )
    assert read_catalogues([("", page)]) == {"en": {"language.name": "English"}}


def test_a_catalogue_is_served_with_the_version_of_its_words(tmp_path: Path) -> None:
    """The version is another one when a word is, so that a browser does not keep old words; English is a module."""

    def listed(stop: str) -> dict[str, dict[str, str]]:
        files = language_files(
            {
                "en": {"language.name": "English"},
                "ar": {"language.name": "العربية", "language.direction": "rtl", "stop": stop},
            }
        )
        assert json.loads(files["/languages/ar.json"])["stop"] == stop
        english, languages = files["/english.js"].decode().splitlines()
        assert english == 'export const ENGLISH = {"language.name":"English"};'
        told: dict[str, dict[str, str]] = json.loads(languages.partition("=")[2].rstrip(";"))
        return told

    first, again, other = listed("قف"), listed("قف"), listed("توقف")
    assert first == again
    assert first["ar"]["version"] != other["ar"]["version"]
    assert (first["ar"]["name"], first["ar"]["direction"], first["en"]["direction"]) == (
        "العربية",
        "rtl",
        "ltr",
    )


def test_the_words_of_a_card_are_served_with_those_of_the_page(tmp_path: Path) -> None:
    """What lies in ``languages`` beside a card; it needs nothing else."""
    folder = folder_with(tmp_path, en={"trip.go": "Go"})
    (folder / "card.js").write_text("")
    files = page_files([Card("trip", folder / "card.js", "left", "")])
    assert json.loads(files["/languages/en.json"].body)["trip.go"] == "Go"
    assert b'"trip.go":"Go"' in files["/english.js"].body
