"""The Debian package's own scripts; what is built is run by packaging/deb/build itself."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from chefbotd.process.installation import plan

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "packaging" / "deb"
pytestmark = pytest.mark.skipif(
    not FOLDER.exists(), reason="the packaging is not part of an installed package"
)


@pytest.mark.parametrize("name", ["build", "postinst", "prerm", "postrm"])
def test_a_script_is_one_that_sh_can_read(name: str):
    """The package manager runs it with /bin/sh, and only if it may be executed."""
    assert (FOLDER / name).stat().st_mode & 0o111
    subprocess.run(["sh", "-n", str(FOLDER / name)], check=True)


@pytest.mark.parametrize(
    ("name", "action"), [("postinst", "abort-upgrade"), ("prerm", "upgrade"), ("postrm", "remove")]
)
def test_an_upgrade_takes_nothing_away(name: str, action: str):
    """What dpkg asks of a script in the middle of an upgrade or a plain removal changes nothing there."""
    done = subprocess.run(
        ["sh", str(FOLDER / name), action, "0.0.1"], capture_output=True, text=True, check=True
    )
    assert (done.stdout, done.stderr) == ("", "")


def test_the_package_has_extras_that_there_are():
    """Those of the Makefile's DEB_EXTRAS: page, name, and what earlier packages had without asking (maps, urdf)."""
    (said,) = re.findall(r"^DEB_EXTRAS \?= ([a-z,]+)\$\(WITH", (ROOT / "Makefile").read_text(), re.MULTILINE)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert (
        {"page", "discovery", "maps", "urdf"} <= set(said.split(",")) <= set(project["optional-dependencies"])
    )


def test_a_purge_names_every_file_that_the_installation_writes() -> None:
    """Where systemd did not run at the removal, they are there still."""
    script = (FOLDER / "postrm").read_text()
    for name in (
        plan.UNIT,
        plan.WANTED_BY,
        plan.RULE,
        plan.SYSUSERS,
        plan.FOLDER,
        plan.STATE,
        plan.CACHE,
        plan.RUNTIME,
    ):
        assert f" {name}" in script


def test_the_package_is_built_of_what_is_locked_by_hashes(tmp_path: Path) -> None:
    """Each package is asked for by the entry of the lock; one that is not locked ends the build."""
    lock, report = tmp_path / "lock", tmp_path / "report"
    lock.write_text(
        "# made\na-b==1.0 ; x\n    --hash=sha256:00\n    # via c\nc==2.0 \\\n    --hash=sha256:11\nd==3\n"
    )
    packages = [
        {"metadata": {"name": name, "version": version}}
        for name, version in (("A_b", "1.0"), ("chefbotd", "9"))
    ]
    report.write_text(json.dumps({"install": packages}))
    command = [sys.executable, str(FOLDER / "locked.py"), str(report), str(lock)]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert told.splitlines()[:2] == ["a-b==1.0 ; x", "    --hash=sha256:00"]
    assert "c==" not in told
    packages[0]["metadata"]["version"] = "1.1"
    report.write_text(json.dumps({"install": packages}))
    refused = subprocess.run(command, capture_output=True, text=True, check=False)
    assert refused.returncode == 1
    assert "a-b 1.1 is not in" in refused.stderr
    build = (FOLDER / "build").read_text()
    assert "--no-deps --require-hashes" in build
