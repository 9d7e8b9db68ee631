"""What pyproject.toml declares is what the code uses, and what docs/dependencies.md gives a reason for."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import chefbotd
import firmware_protocol
from tests.audit import closure

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
DECLARED = {
    group: [Requirement(text) for text in texts]
    for group, texts in {"always": PROJECT["dependencies"], **EXTRAS}.items()
}
FOR_DEVELOPERS = {"dev", "docs", "fuzz", "release"}
IMPORTED_BY_ANOTHER = {"pysdl2-dll": "pysdl2"}
FACES = {"annotated-types": "pydantic", "pydantic-core": "pydantic", "textual-hires-canvas": "textual-plot"}
"""Packages that another one always brings along and speaks in terms of; which version is its affair."""

ADD_ONS = {"chefbot-ros2"}
"""Distributions of our own in addons/, which a command uses where they are installed."""

PINNED = {"pyserial-asyncio"}
"""We build on how it behaves inside."""

LIBRARIES_UNDER_LGPL = {"zeroconf"}
"""Of an extra; imported as it is, and anybody can put another version in its place, as the LGPL asks."""

SILENT_ABOUT_THEIR_LICENCE = {"urdf-parser-py"}
"""BSD, as its sources say."""


def names(groups: set[str]) -> set[str]:
    """The packages that these groups declare."""
    return {canonicalize_name(need.name) for group in groups for need in DECLARED[group]}


FOR_USERS = names(DECLARED.keys() - FOR_DEVELOPERS)


def imported() -> Iterator[str]:
    """The top-level modules that the code imports, standard library and our own too."""
    for package in (chefbotd, firmware_protocol):
        for path in Path(package.__path__[0]).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Import):
                    yield from (alias.name.split(".")[0] for alias in node.names)
                elif isinstance(node, ast.ImportFrom) and not node.level:
                    yield str(node.module).split(".")[0]


@cache
def used() -> set[str]:
    """The packages that these modules come from; one that is not installed goes by its module's name."""
    packages, ours = metadata.packages_distributions(), {"chefbotd", "firmware_protocol"}
    modules = set(imported()) - ours - sys.stdlib_module_names
    return {canonicalize_name(name) for module in modules for name in packages.get(module, (module,))}


@pytest.mark.slow
def test_what_is_imported_is_declared() -> None:
    """Nothing works only because another package happens to bring it along."""
    assert {FACES.get(name, name) for name in used()} - ADD_ONS <= FOR_USERS
    assert "numpy" in used()


@pytest.mark.slow
def test_what_is_declared_is_imported() -> None:
    """Users install nothing that no line of code asks for."""
    assert {IMPORTED_BY_ANOTHER.get(name, name) for name in FOR_USERS} <= used()


@pytest.mark.parametrize("group", DECLARED)
def test_every_dependency_has_its_oldest_version_and_only_one_is_pinned(group: str) -> None:
    """``>=`` and no upper bound, so that users get what mends a hole; the exception is deliberate."""
    for need in DECLARED[group]:
        operators = [specifier.operator for specifier in need.specifier]
        assert operators == (["=="] if canonicalize_name(need.name) in PINNED else [">="]), str(need)


@pytest.mark.parametrize("group", DECLARED)
def test_every_dependency_has_a_reason(group: str) -> None:
    """In the table of docs/dependencies.md for its group, and nothing else is there."""
    page = ROOT / "docs" / "dependencies.md"
    always, extras = page.read_text(encoding="utf-8").split("\n## Considered")[0].split("\n## Extras\n")
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in (always + extras).splitlines()]
    rows = [["always", *row] if len(row) == 2 else row for row in cells if len(row) in (2, 3)]
    told = [
        canonicalize_name(name.split()[0])
        for where, packages, _ in rows
        if where.strip("`") == group
        for name in packages.split(", ")
        if re.match(r"[a-z]", name) and name not in ("package", "why")
    ]
    assert sorted(told) == sorted(names({group}))


def test_an_installation_without_extras_has_neither_image_codecs_nor_an_xml_library() -> None:
    """They are a third of what it would take on a disk, and most robots use neither."""
    assert closure(extras=()).keys() & {"pillow", "urdf-parser-py", "lxml"} == set()
    assert {"numpy", "pydantic-core"} <= closure(extras=()).keys()


def test_a_robot_with_a_lidar_has_what_reads_maps() -> None:
    """``navigation`` brings all of ``maps``, in the same versions."""
    assert set(EXTRAS["maps"]) <= set(EXTRAS["navigation"])


def test_what_users_install_may_be_built_into_anything() -> None:
    """Metadata states a licence for each, and none that reaches beyond the package's own files."""
    for name in closure():
        stated = metadata.metadata(name)
        texts = [stated.get("License-Expression") or "", (stated.get("License") or "").split("\n")[0]]
        texts += [text for text in stated.get_all("Classifier") or () if text.startswith("License ::")]
        assert any(texts) or name in SILENT_ABOUT_THEIR_LICENCE, name
        if name not in LIBRARIES_UNDER_LGPL:
            assert not re.search(r"GPL|GNU|EUPL|SSPL|Proprietary", " ".join(texts)), name
