"""Keys of the configuration that nothing sets: no shipped configuration, no page, example, component or test."""

import ast
import re
import textwrap
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, get_origin

from pydantic import BaseModel

from chefbotd.settings import Settings
from chefbotd.settings.retired import models_in, tables_in

ROOT = Path(__file__).parent.parent
PAGES = (
    "README.md",
    "docs/*.md",
    "docs/how_to/*.md",
    "examples/**/*.md",
    "addons/*/README.md",
    "firmware/*.md",
)
PROGRAMS = "addons", "benchmarks", "chefbotd/components", "examples", "tests"
FENCED = re.compile(r"^ *```toml\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"^ {4}[^\n]*\n(?:^ {4}[^\n]*\n|^\n)*", re.MULTILINE)


def keys_of(model: type[BaseModel], section: str = "") -> Iterator[str]:
    """The path of each key below a section; a key of the tables in a list, or of those by name, has one path."""
    for name, field in model.model_fields.items():
        path = section + (field.alias or name)
        tables = list(models_in(field.annotation))
        if not tables:
            yield path
        for table in tables:
            yield from keys_of(table, f"{path}.")


def set_keys(model: type[BaseModel], table: Any, section: str = "") -> Iterator[str]:
    """The path of each key that a table has, in the form of ``keys_of``; of one that the model lacks too."""
    fields = {field.alias or name: field for name, field in model.model_fields.items()}
    for key, value in table.items():
        annotation = fields[key].annotation if key in fields else None
        if (
            isinstance(value, dict) and get_origin(annotation) is tuple
        ):  # by name, in a file that extends another
            value = list(value.values())
        tables = [inner for _, inner in tables_in(value, annotation, "") if isinstance(inner, dict)]
        kinds = list(models_in(annotation))
        if not tables or not kinds:
            yield section + key
        for kind in kinds:
            for inner in tables:
                yield from set_keys(kind, inner, f"{section}{key}.")


def unset_keys(
    model: type[BaseModel], tables: Iterable[Mapping[str, Any]], programs: Iterable[str]
) -> set[str]:
    """The keys that no table of TOML has at their place, and no program names: as a string, or as an argument."""
    in_tables = {path for table in tables for path in set_keys(model, table)}
    words = {word for program in programs for word in _words(program)}
    return {
        key
        for key in keys_of(model)
        if key not in in_tables and words.isdisjoint((key, key.rpartition(".")[2]))
    }


def page_tables() -> Iterator[Mapping[str, Any]]:
    """The blocks of TOML in all pages."""
    for pattern in PAGES:
        for page in ROOT.glob(pattern):
            yield from tables_of(page.read_text(encoding="utf-8"))


def unset_here() -> set[str]:
    """Those of this tree."""
    tables = [tomllib.loads(path.read_text(encoding="utf-8")) for path in ROOT.glob("config/*.toml")]
    files = (path for folder in PROGRAMS for path in ROOT.glob(f"{folder}/**/*.py"))
    return unset_keys(
        Settings, [*tables, *page_tables()], [path.read_text(encoding="utf-8") for path in files]
    )


def tables_of(page: str) -> Iterator[Mapping[str, Any]]:
    """What a page shows of a configuration: blocks of TOML, and indented ones that are TOML."""
    for block in (*FENCED.findall(page), *INDENTED.findall(page)):
        try:
            yield tomllib.loads(textwrap.dedent(block))
        except tomllib.TOMLDecodeError:
            continue


def _words(program: str) -> Iterator[str]:
    """The strings and the names of arguments; two underlines in one stand for a dot."""
    for node in ast.walk(ast.parse(program)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        elif isinstance(node, ast.keyword) and node.arg is not None:
            yield node.arg.replace("__", ".")
