"""Writes the tables and the examples of docs/api.md, as a part of ``make client``."""

import inspect
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from chefbotd.rpc.encoding import schema
from chefbotd.rpc.method import Method
from chefbotd.rpc.topics import Topic
from tests.fakes.example import example

PAGE = Path(__file__).parents[3] / "docs" / "api.md"
ROW = r"^\| `(\w+)` \|(.*)\|$"
EXAMPLE = r'^(    \{"jsonrpc":"2\.0","id":\d+,"method":"(\w+)".*\})$'


def page(text: str, methods: Mapping[str, Method], topics: Mapping[str, Topic]) -> str:
    """The page with a row for each method and topic, and an example of each method.

    A cell that names all that it has to name stays as somebody has worded it. Any other is written anew.
    """
    rows = _rows(text, "Methods")
    table = [_method_row(each, rows.get(name, [])) for name, each in methods.items()]
    text = _with_rows(text, "Methods", _in_order(table, rows))
    rows = _rows(text, "Topics")
    text = _with_rows(
        text, "Topics", _in_order([_topic_row(t, rows.get(n, [])) for n, t in topics.items()], rows)
    )
    return _with_examples(text, methods)


def _with_examples(text: str, methods: Mapping[str, Method]) -> str:
    before, listed, after = re.split(r"(?<=\nBy example:\n\n)((?:    .*\n)+)", text, maxsplit=1)
    shown = {name: line for line, name in re.findall(EXAMPLE, text, re.MULTILINE)}
    lines = [line for line, name in re.findall(EXAMPLE, listed, re.MULTILINE) if name in methods]
    last = max(json.loads(line)["id"] for line in shown.values())
    for number, name in enumerate([each for each in methods if each not in shown], last + 1):
        params = example(methods[name].params).model_dump(mode="json", exclude_unset=True)
        request = {"jsonrpc": "2.0", "id": number, "method": name} | ({"params": params} if params else {})
        lines.append(f"    {json.dumps(request, separators=(',', ':'))}")
    return before + "\n".join(lines) + "\n" + after


def _rows(text: str, heading: str) -> dict[str, list[str]]:
    """The cells of each row of the table under a heading, by the name in the first one."""
    found = re.findall(ROW, _section(text, heading), re.MULTILINE)
    return {name: [cell.strip() for cell in re.split(r"(?<!\\)\|", rest)] for name, rest in found}


def _section(text: str, heading: str) -> str:
    return text.split(f"\n## {heading}\n")[1].split("\n## ")[0]


def _with_rows(text: str, heading: str, rows: list[str]) -> str:
    section = _section(text, heading)
    old = "\n".join(match[0] for match in re.finditer(ROW, section, re.MULTILINE))
    return text.replace(section, section.replace(old, "\n".join(rows)))


def _in_order(rows: list[str], before: Iterable[str]) -> list[str]:
    """In the order in which they stood; what is new comes last."""
    places = {name: place for place, name in enumerate(before)}
    return sorted(rows, key=lambda row: places.get(row.split("`")[1], len(places)))


def _method_row(method: Method, cells: list[str]) -> str:
    takes, gives = method.params.model_fields, members(method.result)
    old = dict(enumerate(cells))
    params = _kept(old.get(0, ""), list(takes)[:4], takes) or ", ".join(
        f"`{name}`" + ("" if field.is_required() else f" = {json.dumps(field.default)}")
        for name, field in takes.items()
    )
    result = _kept(old.get(1, ""), gives, gives) or ", ".join(f"`{name}`" for name in gives)
    role = "none" if method.role is None else str(method.role)
    does = old.get(3, "") or _cell(inspect.getdoc(method.handle) or "")
    return " | ".join([f"| `{method.name}`", params, result, role, does]).replace("|  |", "| |") + " |"


def members(model: type[Any]) -> dict[str, Any]:
    """What a record has, each with its JSON Schema."""
    return schema(model).get("properties", {})  # type: ignore[no-any-return]


def _cell(text: str) -> str:
    """Text on one line, with its bars escaped: a bar ends a cell."""
    return " ".join(text.split()).replace("|", r"\|")


def _topic_row(topic: Topic, cells: list[str]) -> str:
    fields = {} if topic.name == "stats" else members(topic.model)
    told = (
        f"`{name}`" + (f" ({_cell(field['description'])})" if "description" in field else "")
        for name, field in fields.items()
    )
    row = (
        _kept(cells[0] if cells else "", fields)
        or f"{_cell(inspect.getdoc(topic.model) or '')} {', '.join(told)}"
    )
    return f"| `{topic.name}` | {' '.join(row.split())} |"


def _kept(cell: str, needed: Iterable[str], known: Iterable[str] | None = None) -> str:
    """The cell, where it names all that is needed and nothing unknown, or says that it is as another's."""
    named = re.findall(r"(?<!= )`(\w+)`", re.sub(r"\(.*?\)", "", cell))
    stale = known is not None and not set(named) <= set(known)
    return (
        cell
        if cell.startswith("as ") or not (stale or set(needed) - set(re.findall(r"`(\w+)`", cell)))
        else ""
    )
