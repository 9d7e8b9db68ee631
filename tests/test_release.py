"""What `make release` makes of READMEs, metadata and the CHANGELOG, and what it refuses."""

import importlib.util
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
SCRIPT = ROOT / "packaging" / "release.py"
pytestmark = pytest.mark.skipif(
    not SCRIPT.exists(), reason="the packaging is not part of an installed package"
)
PROJECTS = [ROOT / "pyproject.toml", *sorted(ROOT.glob("addons/*/pyproject.toml"))]


@pytest.fixture(scope="module")
def release() -> Any:
    """The script, as a module."""
    spec = importlib.util.spec_from_file_location("release", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_links_of_a_readme_lead_into_the_repository(release: Any) -> None:
    """Pictures as files, pages as pages, an add-on's from its own folder; what leads elsewhere stays."""
    text = "![a](docs/a.png) [b](../../docs/b.md#c) [d](https://d.example/) [e](#e)"
    told = release.for_index(text, "addons/x", "https://r.example/us/robot", "1.2.0")
    base = "https://r.example/us/robot"
    assert told == (
        f"![a]({base}/raw/v1.2.0/addons/x/docs/a.png) [b]({base}/blob/v1.2.0/docs/b.md#c) "
        "[d](https://d.example/) [e](#e)"
    )


def test_without_a_repository_nothing_dead_is_left(release: Any) -> None:
    """Links become their words, and pictures go."""
    assert release.for_index("![a](a.png)[`b`](b.md), c", ".", "", "1.0") == "`b`, c"


def test_notes_are_the_versions_section(release: Any) -> None:
    """Up to the next one; before it is named, what is unreleased."""
    text = "# Changelog\n\n## Unreleased\n\nnew\n\n## 0.2.0 - 2026-01-01\n\n### A\n\n- b\n\n## 0.1.0\n\nold\n"
    assert release.changes(text, "0.2.0") == "# chefbotd 0.2.0\n\n### A\n\n- b\n"
    assert release.changes(text, "0.3.0") == "# chefbotd 0.3.0\n\nnew\n"


def test_an_incomplete_distribution_is_refused(release: Any, tmp_path: Path) -> None:
    """Each thing that is missing or too much is named."""
    wheel = tmp_path / "x-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as file:
        file.writestr("x/__pycache__/a.pyc", "")
        file.writestr(
            "x-1.0.dist-info/METADATA", "Metadata-Version: 2.4\nName: x\nVersion: 1.0\n\n[a](b.md)\n"
        )
    told = "\n".join(release.check(wheel, "1.0"))
    for problem in ("a.pyc does not belong", "no Author", "Python 3.13", "follow: b.md", "no LICENSE"):
        assert problem in told


@pytest.mark.parametrize("path", PROJECTS, ids=lambda path: path.parent.name)
def test_the_authors_address_is_given_at_the_release(release: Any, path: Path) -> None:
    """No address stands in the sources; what is built has the one that was given."""
    text = path.read_text(encoding="utf-8")
    (author,) = tomllib.loads(text)["project"]["authors"]
    (built,) = tomllib.loads(release.with_email(text, "a@b.example"))["project"]["authors"]
    assert built == {"name": author["name"], "email": "a@b.example"}
    with pytest.raises(SystemExit, match="one author and no address"):
        release.with_email(release.with_email(text, "a@b.example"), "c@d.example")


@pytest.mark.parametrize("path", PROJECTS, ids=lambda path: path.parent.name)
def test_every_distribution_has_complete_metadata_and_the_cores_version(path: Path) -> None:
    """The version is written once, in chefbotd/__init__.py; the licence lies beside each."""
    read = tomllib.loads(path.read_text(encoding="utf-8"))
    project, hatch = read["project"], read["tool"]["hatch"]
    assert project["dynamic"] == ["version"]
    assert (path.parent / hatch["version"]["path"]).resolve() == ROOT / "chefbotd" / "__init__.py"
    assert project["authors"]
    assert project["keywords"]
    assert (path.parent / "LICENSE").read_text() == (ROOT / "LICENSE").read_text()
    assert {f"Programming Language :: Python :: 3.{minor}" for minor in (11, 12, 13)} <= set(
        project["classifiers"]
    )
    assert all(name.startswith("/") for name in hatch["build"]["targets"]["sdist"]["include"])
