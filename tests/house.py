"""How many files, lines, classes and kinds of value the package has: ``python -m tests.house [FOLDER]``.

Everything is read from the sources below the folder, and nothing is imported. The kind of a class is that of the base
class it leads back to. A file is imported by another where that has an ``import`` of it, inside a function too.
"""

import ast
import builtins
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from statistics import median

from rich.console import Console

ROOT = Path(__file__).parents[1]
PACKAGES = ("chefbotd", "firmware_protocol")
SMALL_LINES = 60

KIND_OF_BASE = {
    "Parameters": "pydantic parameters",
    "Params": "pydantic socket parameters",
    "BaseModel": "other pydantic models",
    "Struct": "msgspec records and messages",
    "NamedTuple": "NamedTuple",
    "TypedDict": "keyword arguments",
    "Protocol": "Protocol",
    "StrEnum": "enum",
    "IntEnum": "enum",
    "Enum": "enum",
}
WIRE_KIND = "values of the wire's package"
"""Dataclasses and tuples of ``firmware_protocol``, which knows the standard library only."""

VALUES = (
    "pydantic parameters",
    "pydantic socket parameters",
    "other pydantic models",
    "msgspec records and messages",
    "dataclass",
    "NamedTuple",
    WIRE_KIND,
)
EXCEPTIONS = {
    name
    for name, known in vars(builtins).items()
    if isinstance(known, type) and issubclass(known, BaseException)
}

Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Module:
    """A module's file, its dotted name, whether it is a package's ``__init__``, and its text."""

    path: Path
    name: str
    is_package: bool
    text: str

    @cached_property
    def tree(self) -> ast.Module:
        """Its syntax, parsed when it is first asked for."""
        return ast.parse(self.text)

    @property
    def lines(self) -> int:
        """How many lines the file has."""
        return len(self.text.splitlines())

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing in it but a docstring."""
        return all(
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) for node in self.tree.body
        )

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """Everything in it, what is outside before what is inside: walked through once, which takes longest."""
        return tuple(ast.walk(self.tree))

    def classes(self) -> Iterator[ast.ClassDef]:
        """Every class in it, those inside others too."""
        return (node for node in self.nodes if isinstance(node, ast.ClassDef))

    def functions(self) -> Iterator[Function]:
        """Every function and method in it."""
        return (node for node in self.nodes if isinstance(node, Function))

    @cached_property
    def imports(self) -> tuple[tuple[str, str], ...]:
        """What it imports: the module, and the name from it ("" for the module itself)."""
        return tuple(self._imports())

    def _imports(self) -> Iterator[tuple[str, str]]:
        package = self.name if self.is_package else self.name.rpartition(".")[0]
        for node in self.nodes:
            if isinstance(node, ast.Import):
                yield from ((alias.name, "") for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                parts = package.split(".")
                above = parts[: len(parts) + 1 - node.level] if node.level else []
                origin = ".".join([*above, *([node.module] if node.module else [])])
                yield from ((origin, alias.name) for alias in node.names)


class House:
    """The modules of these packages below a folder."""

    def __init__(self, root: Path, packages: Sequence[str] = PACKAGES) -> None:
        paths = (path for package in packages for path in sorted((root / package).rglob("*.py")))
        self.modules = {module.name: module for module in (read_module(root, path) for path in paths)}

    @cached_property
    def _classes(self) -> dict[tuple[str, str], ast.ClassDef]:
        return {
            (module.name, node.name): node for module in self.modules.values() for node in module.classes()
        }

    def kinds(self) -> Counter[str]:
        """How many classes there are of each kind."""
        return Counter(
            self._kind(module, node) for module in self.modules.values() for node in module.classes()
        )

    def _kind(self, module: Module, node: ast.ClassDef) -> str:
        kind = self._kind_by_bases(module, node)
        if kind in ("dataclass", "NamedTuple") and module.name.startswith("firmware_protocol."):
            return WIRE_KIND
        return KIND_OF_BASE.get(node.name, kind) if kind in VALUES else kind

    def _kind_by_bases(self, module: Module, node: ast.ClassDef) -> str:
        if any(_last_name(decorator) == "dataclass" for decorator in node.decorator_list):
            return "dataclass"
        kinds = [self._kind_of_base(module, node, base) for base in node.bases]
        if "Protocol" in kinds:
            return "Protocol"
        return next((kind for kind in kinds if kind != "plain"), "plain")

    def _kind_of_base(self, module: Module, node: ast.ClassDef, base: ast.expr) -> str:
        name = _last_name(base)
        if name in KIND_OF_BASE:
            return KIND_OF_BASE[name]
        if name in EXCEPTIONS:
            return "exception"
        origins = [module.name, *(origin for origin, imported in module.imports if imported == name)]
        for origin in origins:
            found = self._classes.get((origin, name))
            if found is not None and found is not node:
                return self._kind(self.modules[origin], found)
        return "plain"

    def names_declared_more_than_once(self) -> dict[str, int]:
        """How often each public class name is declared, where that is more than once; the most often first."""
        counts = Counter(node.name for module in self.modules.values() for node in module.classes())
        return {name: count for name, count in counts.most_common() if count > 1 and not name.startswith("_")}

    def importers(self) -> dict[str, set[str]]:
        """The modules that import each module."""
        importers: dict[str, set[str]] = {name: set() for name in self.modules}
        for module in self.modules.values():
            for origin, name in module.imports:
                target = f"{origin}.{name}" if f"{origin}.{name}" in importers else origin
                if target in importers and target != module.name:
                    importers[target].add(module.name)
        return importers

    def small_files_of_one(self) -> dict[str, str]:
        """Each module of under 60 lines that only one other imports, and that other; an ``__init__`` is none."""
        return {
            name: next(iter(importers))
            for name, importers in self.importers().items()
            if len(importers) == 1
            and self.modules[name].lines < SMALL_LINES
            and not self.modules[name].is_package
        }

    def function_lines(self) -> dict[str, int]:
        """The lines of each function from its ``def`` to its end, by its module and name; the longest first."""
        lines = {
            f"{module.name}:{node.lineno} {node.name}": (node.end_lineno or node.lineno) - node.lineno + 1
            for module in self.modules.values()
            for node in module.functions()
        }
        return dict(sorted(lines.items(), key=lambda item: -item[1]))

    def report(self) -> Iterator[str]:
        """Every figure, a line each."""
        modules, kinds = self.modules.values(), self.kinds()
        file_lines, functions = [module.lines for module in modules], self.function_lines()
        yield _row("files", len(file_lines), f"median {median(file_lines):.0f} lines")
        yield _row("lines", sum(file_lines))
        yield _row("classes", kinds.total())
        yield _row(
            "values", sum(kinds[kind] for kind in VALUES), f"of {sum(kind in kinds for kind in VALUES)} kinds"
        )
        for kind in VALUES:
            yield _row(f"  {kind}", kinds[kind])
        for kind in ("Protocol", "exception", "enum", "keyword arguments", "plain"):
            yield _row(f"{kind} classes", kinds[kind])
        repeated = self.names_declared_more_than_once()
        yield _row("class names declared more than once", len(repeated), _listed(repeated))
        yield _row(f"files under {SMALL_LINES} lines that one other imports", len(self.small_files_of_one()))
        yield _row("empty __init__ files", sum(module.is_package and module.is_empty for module in modules))
        longest, lines = next(iter(functions.items()))
        yield _row("longest function", lines, f"lines: {longest}; median {median(functions.values()):.0f}")


def read_module(root: Path, path: Path) -> Module:
    """The module in a file below a folder."""
    parts = path.relative_to(root).with_suffix("").parts
    is_package = parts[-1] == "__init__"
    text = path.read_text(encoding="utf-8")
    return Module(path, ".".join(parts[:-1] if is_package else parts), is_package, text)


def _last_name(node: ast.expr) -> str:
    """The name of a base or a decorator, without its module, its type arguments and what it is called with."""
    while isinstance(node, ast.Subscript | ast.Call):
        node = node.value if isinstance(node, ast.Subscript) else node.func
    return node.attr if isinstance(node, ast.Attribute) else ast.unparse(node)


def _listed(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in list(counts.items())[:12])


def _row(name: str, figure: int, note: str = "") -> str:
    return f"{name:47}{figure:7}  {note}".rstrip()


def main(arguments: Sequence[str]) -> int:
    """Print the figures of the packages below a folder, this checkout's by default; ``--small``: the small files too."""
    folders = [argument for argument in arguments if argument != "--small"]
    house = House(Path(folders[0]) if folders else ROOT)
    console = Console(soft_wrap=True, highlight=False, markup=False)
    for line in house.report():
        console.print(line)
    if not folders:
        from tests.walls import Walls  # it imports this module

        for name, figure, note in Walls(house).report(ROOT):
            console.print(_row(name, figure, note))
        from tests.unset_keys import unset_here

        unset = unset_here()
        console.print(_row("keys that nothing sets", len(unset), ", ".join(sorted(unset))))
    if len(folders) < len(arguments):
        for name, importer in house.small_files_of_one().items():
            console.print(f"{house.modules[name].lines:4} {name} <- {importer}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
