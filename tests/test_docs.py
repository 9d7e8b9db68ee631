"""docs/safety.md says of every fault what the code does, and docs/safety_tests.md names tests that there are."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from chefbotd.driving.obstacle_guard import OBSTACLE
from chefbotd.driving.safety_supervisor import ENCODERS_STALE
from chefbotd.safety.faults import RECOVERABLE, FaultKind
from chefbotd.safety.gate import DEAD_MAN, Mode, SafetyParameters
from chefbotd.safety.scan_guard import SILENT
from chefbotd.safety.watchdog import WatchdogParameters

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "safety.md"
TESTS_PAGE = ROOT / "docs" / "safety_tests.md"
pytestmark = pytest.mark.skipif(
    not PAGE.exists(), reason="the documentation is not part of an installed package"
)
COLUMNS = 6


def rows() -> list[list[str]]:
    """The tables of faults, cell by cell, without their headings."""
    section = PAGE.read_text(encoding="utf-8").split("\n## The table\n")[1].split("\n## ")[0]
    tables = re.findall(r"(?:^\|.*\n)+", section, re.MULTILINE)
    lines = [line for table in tables for line in table.splitlines()[2:]]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def entries() -> list[tuple[str, list[tuple[str, str]]]]:
    """The tests of each row, as file and name, under the row's first cell."""
    text = TESTS_PAGE.read_text(encoding="utf-8")
    found = re.findall(r"^\*\*(.*)\*\*\n\n((?:- .*\n)+)", text, re.MULTILINE)
    return [(title, [reference_in(line) for line in listed.splitlines()]) for title, listed in found]


def reference_in(line: str) -> tuple[str, str]:
    """The file and the name of a test, from its line."""
    match = re.fullmatch(r"- `((?:addons/[\w-]+/)?tests/[\w/]+\.py)::(test_\w+)`", line)
    assert match is not None, line
    return match[1], match[2]


@cache
def names_in(path: Path) -> set[str]:
    """The names of its tests."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))}


def test_every_fault_has_a_test_that_there_is() -> None:
    """Each row is complete, has its entry among the tests, in the same order, and each test of it can be found."""
    assert len(rows()) > 40
    for row in rows():
        assert len(row) == COLUMNS, row
        assert all(row), row
    assert [title for title, _ in entries()] == [row[0] for row in rows()]
    for title, named in entries():
        for path, name in named:
            assert name in names_in(ROOT / path), (title, path, name)


def test_no_test_is_lost_between_the_entries() -> None:
    """Each line of the page that names a test belongs to an entry."""
    text = TESTS_PAGE.read_text(encoding="utf-8")
    assert text.count("::") == sum(len(named) for _, named in entries())


@cache
def fast_names_in(path: Path) -> set[str]:
    """The names of those that `make test` runs: neither they nor their file are marked slow."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    file_marks = [ast.unparse(node) for node in tree.body if isinstance(node, ast.Assign)]
    if any(mark.startswith("pytestmark = ") and "mark.slow" in mark for mark in file_marks):
        return set()
    tests = [node for node in tree.body if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]
    return {
        test.name
        for test in tests
        if not any(ast.unparse(each) == "pytest.mark.slow" for each in test.decorator_list)
    }


def test_every_promise_has_a_test_that_belongs_to_every_change() -> None:
    """Of each row at least one test is not slow, so no change can break what the row says unseen until CI."""
    for title, named in entries():
        assert any(name in fast_names_in(ROOT / path) for path, name in named), title


def test_nothing_that_the_topic_safety_can_tell_is_left_out() -> None:
    """Every fault and every limit is in a row, as a client sees it; every mode is explained."""
    seen = " ".join(row[3] for row in rows())
    for kind in FaultKind:
        assert f"`safety.fault` `{kind}`" in seen, kind
    for limit in (DEAD_MAN, ENCODERS_STALE, OBSTACLE, SILENT):
        assert f"`safety.limited_by` `{limit}`" in seen, limit
    text = PAGE.read_text(encoding="utf-8")
    for mode in Mode:
        assert f"\n- `{mode}`: " in text, mode
    for kind in RECOVERABLE:
        assert f"`{kind}`" in text.split("\n## The table")[0], kind


def test_times_are_those_in_force() -> None:
    """Where a row names a configured time, the number beside it is the default."""
    text, safety = PAGE.read_text(encoding="utf-8"), SafetyParameters()
    for told in (
        f"`command_timeout_s` ({safety.command_timeout_s:g} s",
        f"`max_age_s` ({safety.encoders.max_age_s:g} s)",
        f"`latch_after_s` ({safety.encoders.latch_after_s:.1f} s)",
        f"`critical_s` ({safety.battery.critical_s:g} s)",
        f"`guard.max_age_s` ({safety.guard.max_age_s:g} s)",
        f"`watchdog.timeout_s` ({WatchdogParameters().timeout_s:g} s)",
    ):
        assert told in text, told


@cache
def files_of_tests() -> tuple[Path, ...]:
    """Every file of tests, the add-ons' and the examples' too."""
    folders = ("tests", "addons/*/tests", "examples")
    return tuple(file for folder in folders for file in ROOT.glob(f"{folder}/**/test_*.py"))


TEST_REFERENCE = re.compile(r"`([\w./-]*test_\w+\.py)?(?:::(test_\w+))?[^`\n]*`")
"""A file of tests, a test of it, or a further test of the file that was named last."""


def test_every_test_that_a_page_names_can_be_found() -> None:
    """In each page, and of each reference the file and the name; a reader's own files are called "your ..."."""
    missing, named = [], 0
    for page in (*ROOT.glob("docs/**/*.md"), *ROOT.glob("*.md"), *ROOT.glob("addons/*/*.md")):
        files: list[Path] = []
        for match in TEST_REFERENCE.finditer(page.read_text(encoding="utf-8")):
            file, name = match.groups()
            if page.name == "CHANGELOG.md" or "your_" in (file or "") or not (file or name):
                continue
            if file:
                files = [path for path in files_of_tests() if path.as_posix().endswith(f"/{file}")]
            named += 1
            if not files or (name and not any(name in names_in(path) for path in files)):
                missing.append(f"{page.name}: {match[0]}")
    assert not missing
    assert named > 400


@pytest.mark.parametrize("page", sorted((ROOT / "docs").rglob("*.md")), ids=lambda page: page.stem)
def test_links_between_documents_lead_somewhere(page: Path) -> None:
    """Every relative link names a file that there is."""
    for target in re.findall(r"\]\((?!https?:)([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


def test_the_architecture_names_every_part() -> None:
    """Each package and module at the top, and each feature's room, has its place in the picture."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    picture = page.split("## The parts")[1].split("## Who may know whom")[0]
    package = ROOT / "chefbotd"
    rooms = [path for path in package.iterdir() if (path / "__init__.py").exists()]
    missing = [f"{room.name}/" for room in rooms if f" {room.name}/ " not in picture]
    missing += [
        f.name for f in package.glob("*.py") if f.name != "__init__.py" and f" {f.name} " not in picture
    ]
    features = picture.split("features/ ")[1].split("feature.py:")[0]
    rooms = [path for path in (package / "features").iterdir() if (path / "__init__.py").exists()]
    missing += [f"features/{room.name}" for room in rooms if not re.search(rf"\b{room.name}\b", features)]
    assert not missing


def test_every_table_has_its_line_of_dashes_and_no_heading_a_star() -> None:
    """Without it a table is shown as text with bars in it, and a heading's stars as they stand."""
    wrong = []
    for page in sorted((ROOT / "docs").rglob("*.md")):
        lines, is_code = page.read_text(encoding="utf-8").splitlines(), False
        for number, (before, line, after) in enumerate(
            zip(["", *lines], lines, [*lines[1:], ""], strict=False), 1
        ):
            is_code ^= line.lstrip().startswith("```")
            begins_table = line.startswith("|") and not before.startswith("|")
            if not is_code and begins_table and not re.fullmatch(r"\|[-:| ]+\|", after):
                wrong.append(f"{page.relative_to(ROOT)}:{number}: {line}")
            if not is_code and line.startswith("#") and "**" in line:
                wrong.append(f"{page.relative_to(ROOT)}:{number}: {line}")
    assert wrong == []
