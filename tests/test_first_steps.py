"""What a newcomer reads first: README, CONTRIBUTING and `make help` name only what there is."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.skipif(not (ROOT / "CONTRIBUTING.md").exists(), reason="only the sources have it")
PAGES = ("README.md", "CONTRIBUTING.md")


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page: str) -> None:
    """Every relative link names a file that there is."""
    targets = re.findall(r"\]\((?!https?:)([^)#]+)[^)]*\)", (ROOT / page).read_text(encoding="utf-8"))
    assert targets
    for target in targets:
        assert (ROOT / target).exists(), target


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_make_alone_lists_every_target() -> None:
    """Each with what it does; those that README and CONTRIBUTING speak of are among them."""
    told = subprocess.run(["make", "-C", str(ROOT)], capture_output=True, text=True, check=True).stdout
    listed = set(re.findall(r"^  ([a-z-]+) +\S", told, re.MULTILINE))
    phony = re.findall(r"^\.PHONY: (.+)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert listed == set(" ".join(phony).split())
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        for words in re.findall(r"(?:`|^)make ((?:[a-z-]+ ?)+)", text, re.MULTILINE):
            assert set(words.split()) <= listed, words


def test_the_files_that_readme_runs_with_are_those_that_init_writes() -> None:
    """No command names a file that nobody has made."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shell = " ".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL))
    assert "chefbotd init my-robot " in shell
    assert set(re.findall(r"\S+\.toml", re.sub(r"#.*", "", shell))) == {"my-robot/chefbot.toml"}
