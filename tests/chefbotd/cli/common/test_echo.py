"""How wide sentences are on a terminal."""

import pytest

from chefbotd.cli.common.echo import fold

SENTENCES = "No port was found: is the board plugged in, and powered? " * 5


@pytest.mark.parametrize(("columns", "widest"), [("60", 60), ("80", 80), ("300", 100)])
def test_sentences_are_folded_between_words(
    monkeypatch: pytest.MonkeyPatch, columns: str, widest: int
) -> None:
    """No line is wider than the terminal, nor than 100 columns on a wider one; no word is lost or broken."""
    monkeypatch.setenv("COLUMNS", columns)
    lines = fold(SENTENCES).split("\n")
    assert widest - 12 < max(map(len, lines)) <= widest
    assert " ".join(lines).split() == SENTENCES.split()


def test_what_has_its_own_lines_keeps_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """A path is not broken, and neither short lines nor indents change."""
    monkeypatch.setenv("COLUMNS", "40")
    path = "/home/somebody/" + 5 * "a_long_folder/"
    assert fold(f"two:\n  lines\n{path}") == f"two:\n  lines\n{path}"
