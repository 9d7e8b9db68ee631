"""Edits a TOML file and keeps everything else, comments included, byte for byte.

A comment block directly above a section's header belongs to that section. When something is removed, its comments
stay, with a blank line below them where they would seem to belong to the next section.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import tomlkit
from tomlkit.items import AoT, Comment, InlineTable, Item, Key, Null, Table, Whitespace

Path: TypeAlias = tuple[str, ...]
Changes: TypeAlias = Mapping[str, object]
Part: TypeAlias = tomlkit.TOMLDocument | Table | InlineTable
Body: TypeAlias = list[tuple[Key | None, Item]]

GAP = "\0\n"
"""A line that marks where something was removed, until the text is put together. No TOML has this character."""


class Editor:
    """Changes the values in sections, by path, whether the file has them as headers, dotted keys or inline tables.

    Raises:
        ValueError: the text is not TOML.
    """

    def __init__(self, text: str):
        self._line_end = "\r\n" if 0 < text.count("\n") == text.count("\r\n") else "\n"
        self._is_ended = text.endswith("\n")
        lines = text.replace(self._line_end, "\n")
        self._document = tomlkit.parse(lines if self._is_ended else lines + "\n")
        self._new: dict[str, Any] = {}

    def change(self, path: Path, changes: Changes) -> None:
        """Set keys of a section, or remove them if the value is None. A new section is put at the end of the file."""
        if not changes or self._change_inline(path, changes):
            return
        parts = self._parts(path)
        if not parts:
            _set(_inside(self._new, path), changes)
            return
        for key, value in changes.items():
            part = next((part for part in parts if key in part), parts[-1])
            if value is None:
                _take(part, key)
            elif key in part:
                part[key] = value
            else:
                _append(part, key, value)

    def drop(self, path: Path) -> None:
        """Remove a section."""
        *above, name = path
        if not self._change_inline(tuple(above), {name: None}):
            for part in self._parts(tuple(above)):
                _take(part, name)

    def text(self) -> str:
        """The edited text, with the line ends of the original."""
        text = _close_gaps(tomlkit.dumps(self._document))
        if self._new:
            text += ("" if text.endswith("\n\n") else "\n") + tomlkit.dumps(self._new)
        return (text if self._is_ended else text.removesuffix("\n")).replace("\n", self._line_end)

    def _parts(self, path: Path) -> list[Part]:
        """The tables with keys of a section, in the file's order. With dotted keys there may be several.

        The element of an array of tables is found by its ``name``; the only one of an array may have none.
        """
        parts: list[Part] = [self._document]
        elements: list[Part] = []
        for name in path:
            items = [item for part in parts for _, item in _find_named(part, name)]
            parts = [item for item in items if isinstance(item, Table | InlineTable)]
            parts += _of_name(elements, name)
            elements = [table for item in items if isinstance(item, AoT) for table in item.body]
        return parts

    def _change_inline(self, path: Path, changes: Changes) -> bool:
        """Rewrite the inline table that is or contains this section; returns whether one does."""
        for depth, name in enumerate(path):
            for above in self._parts(path[:depth]):
                for _, table in _find_named(above, name):
                    if isinstance(table, InlineTable):
                        above[name] = _rewritten(table, path[depth + 1 :], changes)
                        return True
        return False


def _body(part: Part) -> Body:
    return part.body if isinstance(part, tomlkit.TOMLDocument) else part.value.body


def _find_named(part: Part, name: str) -> list[tuple[int, Item]]:
    """A table's value of this name and its place. tomlkit's own look-up joins scattered parts into one."""
    return [(at, item) for at, (key, item) in enumerate(_body(part)) if key is not None and key.key == name]


def _of_name(elements: Sequence[Part], name: str) -> list[Part]:
    """The element of this name."""
    named = [element for element in elements if element.get("name") == name]
    return named or [element for element in elements if len(elements) == 1 and "name" not in element]


def _rewritten(table: InlineTable, path: Path, changes: Changes) -> InlineTable:
    values = table.unwrap()
    _set(_inside(values, path), changes)
    return _inline(values)


def _inline(values: Mapping[str, object]) -> InlineTable:
    table = tomlkit.inline_table()
    for key, value in values.items():
        table.append(key, _inline(value) if isinstance(value, dict) else value)
    return table


def _inside(values: dict[str, Any], path: Path) -> dict[str, Any]:
    for name in path:
        values = values.setdefault(name, {})
    return values


def _set(values: dict[str, Any], changes: Changes) -> None:
    values.update(changes)
    for key in [key for key, value in values.items() if value is None]:
        del values[key]


def _append(part: Part, key: str, value: object) -> None:
    """Add a key below the others, but above comments that follow a blank line or belong to the next section."""
    body = _body(part)
    end = _end_of_keys(body)
    cut = next((at for at in range(end, len(body)) if _is_blank(body[at][1])), end)
    rest = body[cut:]
    del body[cut:]
    part.append(key, value)
    body.extend(rest)


def _end_of_keys(body: Body) -> int:
    return max((at + 1 for at, (key, _) in enumerate(body) if key is not None), default=0)


def _is_blank(item: Item) -> bool:
    return isinstance(item, Whitespace) and "\n" in item.s


def _take(part: Part, name: str) -> None:
    """Remove a key or a section, and leave its comments.

    They are put in as whitespace, which tomlkit writes as it is: a comment would make a header for a table that has
    only sections.
    """
    items = _find_named(part, name)
    if not items:
        return
    left = [(at, _leavings(item)) for at, item in items]
    part.remove(name)
    for at, text in left:
        _body(part)[at] = (None, Whitespace(text))


def _leavings(item: Item) -> str:
    """The comments of the removed part, a gap, and the lines below its last key."""
    body = item.value.body if isinstance(item, Table) else []
    end = _end_of_keys(body)
    comments = "".join(_comments([item, *(inner for _, inner in body[:end])]))
    return comments + GAP + "".join(inner.as_string() for _, inner in body[end:])


def _comments(items: Sequence[Item]) -> Iterator[str]:
    for item in items:
        if not isinstance(item, Whitespace | Null) and item.trivia.comment:
            indent = item.trivia.indent if isinstance(item, Comment) else ""
            yield f"{indent}{item.trivia.comment}\n"


def _close_gaps(text: str) -> str:
    """Set blank lines where something was removed: never two, none at the end, and one between comments."""
    text = re.sub(rf"\n+({GAP}\n*)+\Z", "\n", text)
    text = re.sub(rf"(\A|(?<=\n\n))({GAP}\n*)+", "", text)
    text = re.sub(rf"({GAP})+(?=([ \t]*#.*\n)*[ \t]*\[)", "\n", text)
    return text.replace(GAP, "")


def toml_value(value: object) -> str:
    """A value as TOML writes it."""
    return tomlkit.item(value).as_string()
