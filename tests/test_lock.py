"""requirements.lock: what `make` installs, each with its hashes, as pyproject.toml allows."""

import re
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

LOCK = Path("requirements.lock").read_text(encoding="utf-8")
PYTHONS = ("3.11.0", "3.12.0", "3.13.0", "3.14.0")


def locked() -> dict[str, list[tuple[Requirement, str]]]:
    """Each locked version by name, and the text with its hashes."""
    found: dict[str, list[tuple[Requirement, str]]] = {}
    for entry in re.split(r"\n(?=\S)", LOCK):
        if entry.startswith("#"):
            continue
        need = Requirement(entry.partition(" \\")[0])
        found.setdefault(canonicalize_name(need.name), []).append((need, entry))
    return found


def wanted() -> list[Requirement]:
    """What pyproject.toml asks for in the extras that `make` installs, and to build."""
    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))
    extras = re.search(r"^EXTRAS := (.*)$", Path("Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert extras is not None
    offered = project["project"]["optional-dependencies"]
    chosen = [need for extra in ("dev", "docs", "release", *extras[1].split(",")) for need in offered[extra]]
    needs = [*project["project"]["dependencies"], *chosen, *project["build-system"]["requires"]]
    return [Requirement(need) for need in needs]


def test_every_dependency_is_locked_within_its_range() -> None:
    """For each Python there is one version, and pyproject.toml allows it: after a change of either, `make lock`."""
    known = locked()
    for need in wanted():
        entries = known.get(canonicalize_name(need.name), [])
        for python in PYTHONS:
            environment = {"python_version": python.rpartition(".")[0], "python_full_version": python}
            versions = [
                str(entry.specifier).removeprefix("==")
                for entry, _ in entries
                if entry.marker is None or entry.marker.evaluate(environment)
            ]
            assert len(versions) == 1, f"{need} on Python {python}: {versions}"
            assert need.specifier.contains(versions[0]), f"{need} is locked to {versions[0]}"


def test_every_locked_package_is_pinned_and_has_hashes() -> None:
    """One version, and the hash of at least one file."""
    for entries in locked().values():
        for need, text in entries:
            assert re.fullmatch(r"==[^*,]+", str(need.specifier)), need
            assert re.search(r"--hash=sha256:[0-9a-f]{64}", text), need


def test_the_lock_names_no_place_to_download_from() -> None:
    """It is as good on any computer: where pip looks is that computer's own affair."""
    assert not re.search(r"://|--(extra-)?index|--find-links|--trusted", LOCK)
