"""What a key of a configuration is for, in the words of the model: under its field, or where the class speaks of it."""

import ast
import inspect
import re
import textwrap
from functools import cache

from pydantic import BaseModel
from pydantic.fields import FieldInfo

SENTENCE = re.compile(r"(?<=\.)\s+(?=[A-Z`(0-9])")


def text_of(model: type[BaseModel], name: str, field: FieldInfo) -> str:
    """One sentence or two about the key of this field, as Markdown; empty where the model says nothing of it."""
    words = (
        _under_field(model, name) or field.description or _sentences_on(model, {name, field.alias or name})
    )
    text = re.sub(r"\bNone: ", "left out: ", re.sub(r"\s+", " ", words).strip().replace("``", "`"))
    return text if not text or text.endswith(".") else f"{text}."


def _sentences_on(model: type[BaseModel], names: set[str]) -> str:
    sentences = SENTENCE.split(re.sub(r"\s+", " ", inspect.getdoc(model) or ""))
    return " ".join(one for one in sentences if any(f"``{name}``" in one for name in names))


def _under_field(model: type[BaseModel], name: str) -> str:
    """The string under a field, in the class that declares it."""
    for owner in model.__mro__:
        if issubclass(owner, BaseModel) and name in inspect.get_annotations(owner):
            return _strings_in(owner).get(name, "")
    return ""


@cache
def _strings_in(owner: type[BaseModel]) -> dict[str, str]:
    """The strings under all fields of a class; pydantic would read them too, but at each start of the daemon."""
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(owner))).body
    assert isinstance(tree, ast.ClassDef)  # noqa: S101 - it is the source of a class
    texts = {}
    for field, below in zip(tree.body, tree.body[1:], strict=False):
        if not isinstance(field, ast.AnnAssign):
            continue
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            texts[ast.unparse(field.target)] = str(below.value.value)
    return texts
