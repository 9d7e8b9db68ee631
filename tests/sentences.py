"""The sentences with an id that the code has: found in its source."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import chefbotd

ROOT = Path(chefbotd.__file__).parent


@cache
def modules() -> tuple[tuple[Path, ast.Module], ...]:
    """Each module of the package, parsed."""
    return tuple((path, ast.parse(path.read_text(encoding="utf-8"))) for path in sorted(ROOT.rglob("*.py")))


def patterns() -> Iterator[tuple[str, str]]:
    """The id and the pattern of every sentence in the code."""
    for _, module in modules():
        for node in ast.walk(module):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Sentence":
                yield ast.literal_eval(node.args[0]), ast.literal_eval(node.args[1])


def as_template(pattern: str) -> str:
    """The pattern as a catalogue has it: without formats."""
    return re.sub(r"\{(\w+)[!:][^}]*\}", r"{\1}", pattern)
