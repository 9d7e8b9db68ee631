"""Writes the methods, with an example of each, and the topics of docs/api.md, as a part of ``make client``."""

import inspect
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from jsonschema import Draft202012Validator
from pydantic import ValidationError

from chefbotd.rpc.encoding import plain, schema
from chefbotd.rpc.method import Method
from chefbotd.rpc.topics import Topic
from tests.fakes.example import example

PAGE = Path(__file__).parents[3] / "docs" / "api.md"
ROW = r"^\| `(\w+)` \|(.*)\|$"
METHOD = r"^### `(\w+)`\n\n(.*?)(?=^### |\Z)"
EXAMPLE = r"^```json\n(.*?)^```\n"
NOTHING, CUT_SHORT = "none", "…"


class Pair(NamedTuple):
    """A request of an example, and its answer."""

    request: dict[str, Any]
    answer: dict[str, Any]


class Entry(NamedTuple):
    """What the page says of a method."""

    does: str
    parameters: str
    result: str
    examples: list[Pair]


def page(text: str, methods: Mapping[str, Method], topics: Mapping[str, Topic]) -> str:
    """The page with an entry and an example for each method, and a row for each topic.

    What names all that it has to name stays as somebody has worded it, and so does an example that its models allow.
    All else is written anew.
    """
    entries = inputs_of(text)
    names = _in_order(methods, entries)
    numbers = count(1)
    written = [_entry(methods[name], entries.get(name), numbers) for name in names]
    text = _with_section(text, "Methods", f"{_before_the_entries(text)}{''.join(written)}")
    rows = _rows(text, "Topics")
    written = [_topic_row(topics[name], rows.get(name, [])) for name in _in_order(topics, rows)]
    return _with_rows(text, "Topics", written)


def inputs_of(text: str) -> dict[str, Entry]:
    """Each method that the page has, by its name, in the page's order."""
    found = re.findall(METHOD, section(text, "Methods"), re.MULTILINE | re.DOTALL)
    return {name: _parsed(entry) for name, entry in found}


def _parsed(entry: str) -> Entry:
    lines = "".join(re.findall(EXAMPLE, entry, re.MULTILINE | re.DOTALL)).splitlines()
    sent = [json.loads(line) for line in lines]
    pairs = [Pair(*pair) for pair in zip(sent[::2], sent[1::2], strict=True)]
    does, _, rest = entry.partition("\n- Role: ")
    parameters, result = re.findall(r"^- (?:Parameters|Result): (.*)$", rest, re.MULTILINE)
    return Entry(does.strip(), parameters, result, pairs)


def section(text: str, heading: str) -> str:
    """What stands under a heading."""
    return text.split(f"\n## {heading}\n")[1].split("\n## ")[0]


def _before_the_entries(text: str) -> str:
    return re.split(r"^### ", section(text, "Methods"), maxsplit=1, flags=re.MULTILINE)[0]


def _with_section(text: str, heading: str, written: str) -> str:
    return text.replace(section(text, heading), written.rstrip("\n") + "\n")


def _entry(method: Method, old: Entry | None, numbers: Iterator[int]) -> str:
    takes, gives = method.params.model_fields, members(method.result)
    parameters = _kept(old.parameters if old else "", list(takes)[:4], takes) or ", ".join(
        f"`{name}`" + ("" if field.is_required() else f" = {json.dumps(field.default)}")
        for name, field in takes.items()
    )
    result = _kept(old.result if old else "", gives, gives) or ", ".join(f"`{name}`" for name in gives)
    does = old.does if old else _prose(inspect.getdoc(method.handle) or "")
    pairs = [pair for pair in (old.examples if old else []) if is_possible(pair, method)]
    shown = "\n".join(_shown(pair, next(numbers)) for pair in pairs or [_made(method)])
    role = "none" if method.role is None else str(method.role)
    return (
        f"### `{method.name}`\n\n{does}\n\n- Role: {role}\n- Parameters: {parameters or NOTHING}\n"
        f"- Result: {result or NOTHING}\n\n```json\n{shown}\n```\n\n"
    )


def _shown(pair: Pair, number: int) -> str:
    """Both lines, with the number by which they belong together."""
    return "\n".join(
        json.dumps(line | {"id": number}, separators=(",", ":"), ensure_ascii=False) for line in pair
    )


def _made(method: Method) -> Pair:
    """An example that is valid; somebody may put a better one in its place."""
    params = example(method.params).model_dump(mode="json", exclude_unset=True)
    request = {"jsonrpc": "2.0", "id": 0, "method": method.name} | ({"params": params} if params else {})
    return Pair(request, {"jsonrpc": "2.0", "id": 0, "result": plain(example(method.result))})


def is_possible(pair: Pair, method: Method) -> bool:
    """Whether a client may send this request, and the daemon may answer so: no member is missing or unknown.

    An answer that is cut short says so by a member ``"…"``; then members may be missing.
    """
    model: Any = method.result
    answer, rules = dict(pair.answer["result"]), _valid_schema(model)
    if answer.pop(CUT_SHORT, None) is not None:
        rules = {key: rule for key, rule in rules.items() if key != "required"}
        missing: set[str] = set()
    else:
        missing = rules.get("properties", {}).keys() - answer.keys()
    unknown = answer.keys() - rules["properties"].keys() if "properties" in rules else set()
    try:
        method.params.model_validate(pair.request.get("params", {}))
    except ValidationError:
        return False
    fits = Draft202012Validator(rules).is_valid(answer)
    return fits and pair.request["method"] == method.name and not missing and not unknown


@cache
def _valid_schema(model: Any) -> dict[str, Any]:
    """A result's schema; raises where it is no JSON Schema, which takes longer than all else of a page."""
    rules = schema(model)
    Draft202012Validator.check_schema(rules)
    return rules


def _rows(text: str, heading: str) -> dict[str, list[str]]:
    """The cells of each row of the table under a heading, by the name in the first one."""
    found = re.findall(ROW, section(text, heading), re.MULTILINE)
    return {name: [cell.strip() for cell in re.split(r"(?<!\\)\|", rest)] for name, rest in found}


def _with_rows(text: str, heading: str, rows: list[str]) -> str:
    before = section(text, heading)
    old = "\n".join(match[0] for match in re.finditer(ROW, before, re.MULTILINE))
    return text.replace(before, before.replace(old, "\n".join(rows)))


def _in_order(names: Iterable[str], before: Iterable[str]) -> list[str]:
    """In the order in which they stood; what is new comes last."""
    places = {name: place for place, name in enumerate(before)}
    return sorted(names, key=lambda name: places.get(name, len(places)))


def members(model: type[Any]) -> dict[str, Any]:
    """What a record has, each with its JSON Schema."""
    return schema(model).get("properties", {})  # type: ignore[no-any-return]


def _prose(text: str) -> str:
    """A docstring as Markdown, on one line."""
    return " ".join(text.split()).replace("``", "`")


def _cell(text: str) -> str:
    """The same, with its bars escaped: a bar ends a cell."""
    return _prose(text).replace("|", r"\|")


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
