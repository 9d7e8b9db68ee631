"""Which files the page has, and that what it says itself knows no component."""

import gzip
import json
import re
from importlib import import_module
from pathlib import Path

import pytest

from chefbotd.component_list import own_components
from chefbotd.composition.network import cards_of
from chefbotd.transport.web import server
from chefbotd.transport.web.server import Card, page_files

PAGE = Path(server.__file__).parent / "page"


def listed(body: bytes) -> list[dict[str, str]]:
    """The cards that ``cards.js`` lists."""
    cards: list[dict[str, str]] = json.loads(body.decode().partition("=")[2].rstrip(";\n"))
    return cards


def test_what_lies_beside_a_card_is_served_beside_it(tmp_path: Path) -> None:
    """Its other modules, and nothing else of its folder; the card alone is listed. One that is missing is left out."""
    for name in ("card.js", "plot.js", "secret.py"):
        (tmp_path / name).write_text(name)
    cards = [
        Card("trip", tmp_path / "card.js"),
        Card("lost", tmp_path / "no" / "card.js"),
    ]
    files = page_files(cards)
    ours = {path: file.body for path, file in files.items() if path.startswith("/components/")}
    assert ours == {"/components/trip/card.js": b"card.js", "/components/trip/plot.js": b"plot.js"}
    assert [card["module"] for card in listed(files["/cards.js"].body)] == ["./components/trip/card.js"]


def test_each_import_of_a_module_of_the_page_is_served() -> None:
    """Of all our cards too, which import what the page has, and what another component has."""
    parts = [(component.name, part) for component in own_components() for part in component.page]
    files = page_files(cards_of(parts))
    for path, file in files.items():
        for name in re.findall(r'^import .* from "(.+)";$', file.body.decode(), re.MULTILINE):
            origin = Path("/", *Path(path).parent.parts[1:], name)
            assert str(origin.resolve()) in files, (path, name)


def test_the_pages_own_modules_ask_for_nothing_of_maps_and_goals() -> None:
    """Each capability has its card in its component's folder, and comes through the same door as a stranger's."""
    asked = re.compile(r'"(\w*(?:map|navigat|localiz|place|waypoint|_pose|goal|cost|obstacle)\w*)"')
    names = {
        (path.name, name)
        for path in PAGE.glob("*.js")
        if path.name != "words.js"
        for name in asked.findall(path.read_text(encoding="utf-8"))
    }
    assert names == set()


def test_the_pages_own_style_sheet_styles_no_component() -> None:
    """What the element of a component's card looks like is said in the style sheet beside the card."""
    parts = [component.page[0] for component in own_components() if component.page]
    folders = [
        Path(str(import_module(part.package).__file__)).parent / Path(part.file).parent for part in parts
    ]
    theirs = {
        name
        for folder in folders
        for path in folder.glob("*.js")
        for name in re.findall(r'id="([\w-]+)"', path.read_text(encoding="utf-8"))
    }
    style = (PAGE / "style.css").read_text(encoding="utf-8")
    assert len(theirs) > 50
    assert {name for name in theirs if re.search(rf"#{name}\b(?!-)", style)} == set()


MOST_COMPRESSED_BYTES = 150_000


@pytest.mark.parametrize("language", ["en", "de", "es", "ar"])
def test_the_whole_page_is_light(language: str) -> None:
    """With every card of ours and one language, compressed as it is sent: 150 kB at most."""
    parts = [(component.name, part) for component in own_components() for part in component.page]
    files = page_files(cards_of(parts))
    loaded = [
        path
        for path in files
        if path == f"/languages/{language}.json" or (path != "/index.html" and ".json" not in path)
    ]
    assert f"/languages/{language}.json" in loaded
    assert sum(len(files[path].compressed) for path in loaded) < MOST_COMPRESSED_BYTES
    assert all(gzip.decompress(file.compressed) == file.body for file in files.values())


def test_a_style_sheet_with_the_name_of_a_card_is_listed_with_it(tmp_path: Path) -> None:
    """One that lies beside it under another name is served and not listed; a card without one lists none."""
    for name in ("card.js", "card.css", "print.css"):
        (tmp_path / name).write_text(name)
    (tmp_path / "plain").mkdir()
    (tmp_path / "plain" / "card.js").write_text("")
    files = page_files([Card("trip", tmp_path / "card.js"), Card("plain", tmp_path / "plain" / "card.js")])
    styles = [card["style"] for card in listed(files["/cards.js"].body)]
    assert styles == ["./components/trip/card.css", ""]
    assert files["/components/trip/print.css"].body == b"print.css"
