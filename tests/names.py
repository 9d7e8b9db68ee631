"""Refuses names that say nothing, or too many things: ``python -m tests.names``, a part of ``make lint``.

A name says what a thing is (``message``, ``poses``), in the field's own terms. The words below say only that there is
something: each was given to dozens of different things. ``WORDS`` is the one list; it is short on purpose.
"""

import ast
import sys
from collections.abc import Iterable, Iterator
from typing import Any

from tests.house import ROOT, House
from tests.walls import Walls

WORDS = frozenset(
    {"told", "found", "each", "known", "wanted", "there", "way", "anew", "somebody", "taken", "bury", "glow"}
)
"""Names of variables, parameters, functions and attributes, with or without leading underscores.

Not of the fields of a record: they are keys of the socket, of files and of recordings.
"""

CLASSES = frozenset(
    {
        "Awareness",
        "Beginnings",
        "Contenders",
        "EdgeBasket",
        "Hears",
        "Intake",
        "Known",
        "Meets",
        "Orders",
        "Piece",
    }
    | {"Rung", "Shown", "Taken", "Told", "Whereabouts"}
)
"""Names of classes that a reader has to look up."""

MOST_COMMON = 60
"""So many names of methods at most may be in four classes or more: a name that many share cannot be searched."""


def refused(nodes: Iterable[Any]) -> Iterator[tuple[int, str]]:
    """The line and the name of each definition that says nothing; what is outside comes before what is inside."""
    fields = set()
    for node in nodes:
        if isinstance(node, ast.AnnAssign) and node.value is None:
            fields.add(id(node.target))
        elif isinstance(node, ast.ClassDef):
            if node.name.strip("_") in CLASSES:
                yield node.lineno, node.name
        elif id(node) not in fields and (name := _defined(node)) is not None and name.strip("_") in WORDS:
            yield node.lineno, name


def _defined(node: ast.AST) -> str | None:
    match node:
        case ast.Name(ctx=ast.Store()):
            return node.id
        case ast.Attribute(ctx=ast.Store()):
            return node.attr
        case ast.arg():
            return node.arg
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            return node.name
    return None


def main() -> int:
    """Print each refused name with its place, and whether too many classes share theirs; 1 if there is any."""
    house, examples = House(ROOT), House(ROOT, ("examples",))
    count = 0
    for module in (*house.modules.values(), *examples.modules.values()):
        for line, name in sorted(set(refused(module.nodes))):
            where = f"{module.path.relative_to(ROOT)}:{line}"
            print(f"{where}: {name!r} says nothing: name it for what it is (tests/names.py)")  # noqa: T201
            count += 1
    common = Walls(house).common_method_names()
    if len(common) > MOST_COMMON:
        rare = ", ".join(name for name, classes in common.items() if classes == min(common.values()))
        shared = f"{len(common)} names of methods are in four classes or more, expected {MOST_COMMON} at most: {rare}"
        print(shared)  # noqa: T201
        return 1
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
