"""Refusals and reasons are sentences for people: a page, a screen reader or a voice can say them as they are.

What a program needs is the error's ``kind``, whose meaning names the remedy's method (``describe``, docs/api.md).
"""

import ast
import re
from collections.abc import Iterator

import pytest

from tests.sentences import ROOT, modules

NOT_ON_THE_PAGE = re.compile(
    r"(cli|client|process|settings|snapshot|testing)\b"
    r"|components/(doctor|flash|new_robot|simulation|\w+/cli|\w+/(component|client_methods)|recording/(replay|encoder)|calibration/calibrated_file|tuning/gains_file)\b"
    r"|rpc/(jsonrpc|access|parameters)\.py|transport/web/server\.py"
)
"""What is read on a terminal, in a recording or as HTTP."""

UNSEEN = {"ValueError", "TypeError", "Field", "Meta", "debug", "info", "warning", "error"}
"""Calls whose texts the page never shows: bad configuration, the descriptions of models, the log.

Nor does it show what the kinds of errors mean.
"""

FOR_PROGRAMS = re.compile(
    r"[a-z0-9]_[a-z]|\bsend '?[a-z]+'?\b(?! it)|(?<!\w)\[[a-z]+\]|'[a-z]+' allows|\bchefbotctl\b"
)
"""Names of parameters, methods, keys and commands."""

PLACE = re.compile(r"\{\w+(![ra])?(:[^}]*)?\}")
"""Where an argument stands in the pattern of a sentence: its name is not shown."""


def sentences(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Every text with a space in it that may be shown, by its line."""
    unseen: set[int] = set()
    for node in ast.walk(tree):
        docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        kinds = isinstance(node, ast.ClassDef) and "CodedKind" in map(_name, node.bases)
        if docstring or kinds or (isinstance(node, ast.Call) and _name(node.func) in UNSEEN):
            unseen.update(id(each) for each in ast.walk(node))
    for node in ast.walk(tree):
        is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        if is_text and id(node) not in unseen and " " in node.value.strip():
            yield node.lineno, node.value


def _name(function: ast.expr) -> str:
    return getattr(function, "id", getattr(function, "attr", ""))


def test_no_sentence_names_a_parameter_a_method_or_a_key() -> None:
    """Refusals, reasons of stops, of goals and of devices: whatever the page can show says what to do in words."""
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text}"
        for path, module in modules()
        if not NOT_ON_THE_PAGE.match(str(path.relative_to(ROOT)))
        for line, text in sentences(module)
        if FOR_PROGRAMS.search(PLACE.sub("", text))
    ]
    assert found == []


@pytest.mark.parametrize(
    "text",
    [
        "there is an unfinished map: continue it (unfinished = true), or send discard_mapping",
        "the robot is disarmed; send 'arm' first",
        "the board has restarted; 'arm' allows motion again",
        "nothing is kept in memory: [recording] ring_s is 0",
        "check the gains ([pid])",
        "; mend that, then send localize",
    ],
)
def test_what_is_for_programs_is_recognized(text: str) -> None:
    """The sentences that people were shown once."""
    assert FOR_PROGRAMS.search(text)
