"""Extension of Sphinx: fills the page of commands with what their manual pages say."""

from typing import Any

from chefbotd.cli.programs.manual import markdown, pages

PAGE = "reference/commands"
PLACEHOLDER = "% commands"


def setup(app: Any) -> dict[str, bool]:
    """Sphinx: calls us with the text of each page."""
    app.connect("source-read", _fill)
    return {"parallel_read_safe": True}


def _fill(app: object, page: str, source: list[str]) -> None:
    """Put every command into its page."""
    if page != PAGE:
        return
    if PLACEHOLDER not in source[0]:
        raise ValueError(f"docs/{PAGE}.md has no line {PLACEHOLDER!r}, where the commands belong")
    source[0] = source[0].replace(PLACEHOLDER, "\n".join(markdown(*page) for page in pages()))
