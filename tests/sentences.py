"""The sentences with an id that the code has: found in its source."""

import ast
import gc
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import chefbotd

ROOT = Path(chefbotd.__file__).parent


@cache
def modules(containing: str = "") -> tuple[tuple[Path, ast.Module], ...]:
    """Each module of the package whose source has this text, parsed.

    They stay for all tests, so the garbage collector passes over them: it took three quarters of the time.
    """
    sources = ((path, path.read_text(encoding="utf-8")) for path in sorted(ROOT.rglob("*.py")))
    gc.disable()
    try:
        return tuple((path, ast.parse(text)) for path, text in sources if containing in text)
    finally:
        gc.freeze()
        gc.enable()


@cache
def patterns() -> tuple[tuple[str, str], ...]:
    """The id and the pattern of every sentence in the code."""
    return tuple(
        (ast.literal_eval(node.args[0]), ast.literal_eval(node.args[1]))
        for _, module in modules("Sentence(")
        for node in ast.walk(module)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Sentence"
    )


def as_template(pattern: str) -> str:
    """The pattern as a catalogue has it: without formats."""
    return re.sub(r"\{(\w+)[!:][^}]*\}", r"{\1}", pattern)


SAYS = {
    "Refused": 1,
    "Unserved": 1,
    "MapStoreError": 1,
    "RecordingError": 1,
    "WorkerLost": 0,
    "Fault": 1,
    "LinkHealth": 1,
    "LidarHealth": 1,
    "NoPath": 0,
    "CameraLost": 0,
    "SilentCamera": 0,
}
"""What says why for people, and which of its arguments that is."""

REASONS = {"reason", "warning", "guard_warning"}
"""The texts of topics that say why, as arguments by their names."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def unnamed_reasons() -> Iterator[str]:
    """Where the package says why by a text without an id: the place and the text."""
    for path, module in modules():
        for function in ast.walk(module):
            if isinstance(function, Function):
                for call, text in _reasons_in(function):
                    if _is_plain(text, function):
                        place = path.relative_to(ROOT).as_posix()
                        yield f"{place}: {ast.unparse(call.func)}: {ast.unparse(text)}"


def _reasons_in(function: Function) -> Iterator[tuple[ast.Call, ast.expr]]:
    for call in ast.walk(function):
        if isinstance(call, ast.Call):
            called = ast.unparse(call.func)
            position = SAYS.get(called.rpartition(".")[2])
            if position is not None and len(call.args) > position:
                yield call, call.args[position]
            if not called.startswith(("log.", "logged", "Sentence", "self._limited_log")):
                yield from ((call, word.value) for word in call.keywords if word.arg in REASONS)


def _is_plain(text: ast.expr, function: Function, depth: int = 0) -> bool:
    """Whether it is, or may be, words that were put together here."""
    match text:
        case ast.JoinedStr() | ast.BinOp():
            return True
        case ast.Constant(value=str(words)):
            return words != ""
        case ast.IfExp():
            return any(_is_plain(part, function, depth) for part in (text.body, text.orelse))
        case ast.BoolOp():
            return any(_is_plain(part, function, depth) for part in text.values)
        case ast.Call():
            called = ast.unparse(text.func)
            return called.endswith((".join", ".format")) or (called == "str" and _is_error(text.args))
        case ast.Name() if depth < 3:
            values = (
                node.value
                for node in ast.walk(function)
                if isinstance(node, ast.Assign)
                and any(isinstance(target, ast.Name) and target.id == text.id for target in node.targets)
            )
            return any(_is_plain(value, function, depth + 1) for value in values)
    return False


def _is_error(arguments: list[ast.expr]) -> bool:
    """What an operating system says has no id."""
    return not (len(arguments) == 1 and isinstance(arguments[0], ast.Name) and "error" in arguments[0].id)
