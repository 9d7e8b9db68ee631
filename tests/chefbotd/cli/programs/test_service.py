"""chefbotd install-service and uninstall-service, as they are typed."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs import service as commands
from chefbotd.cli.programs.chefbotd import main
from chefbotd.process.installation import plan, steps
from chefbotd.process.installation.steps import Host

SYSTEM = Path("/")


class NotThisComputer(Host):
    """A host that is never the computer on which the tests run, whoever runs them."""

    def __init__(self, root: Path = SYSTEM) -> None:
        assert root != SYSTEM, "a test was about to change this computer"
        super().__init__(root)


PROGRAM = "/opt/chefbotd/bin/chefbotd"
NEEDED = ("systemd-sysusers", "systemctl", "fakeroot")


@pytest.fixture(autouse=True)
def program(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """An installed program."""
    path = tmp_path / "root" / "opt" / "chefbotd" / "bin" / "chefbotd"
    monkeypatch.setattr(commands, "_program", lambda: path)
    monkeypatch.setattr(steps, "Host", NotThisComputer)
    return path


def test_a_dry_run_says_everything_and_writes_nothing(tmp_path: Path):
    """The folder stays empty; as JSON each step says whether it would change something."""
    root = tmp_path / "root"
    root.mkdir()
    plain = CliRunner().invoke(main, ["install-service", "--dry-run", "--root", str(root)])
    assert plain.exit_code == 0
    asked = CliRunner().invoke(main, ["install-service", "--dry-run", "--root", str(root), "--json"])
    told = json.loads(asked.output)
    assert told["dry_run"] is True
    assert [step["step"] for step in told["steps"]] == plain.output.splitlines()
    unchanged = [step["step"] for step in told["steps"] if not step["changes"]]
    assert unchanged == [
        "its page is off, because /opt/chefbotd/bin/chefbotd has no extra 'page' yet: [page] enabled = true turns it on",
        f"/opt/chefbotd/bin/chefbotd: not in {root} yet; the unit starts it, so install it there",
    ]
    assert list(root.iterdir()) == []


def test_a_folder_named_from_here_is_told_to_systemd_by_its_whole_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its tools look for ``image/etc`` within the image itself, and fail."""
    (tmp_path / "image").mkdir()
    monkeypatch.chdir(tmp_path)
    for folder in ("image", "./image", "../" + tmp_path.name + "/image"):
        dry = ["install-service", "--dry-run", "--root", folder, "--program", PROGRAM]
        printed = CliRunner().invoke(main, dry).output
        assert f"systemd-sysusers --root={tmp_path}/image {tmp_path}/image/etc/" in printed.replace(
            "\n", " "
        ), folder


@pytest.mark.parametrize("command", ["install-service", "uninstall-service"])
def test_without_root_the_command_to_type_is_told(
    monkeypatch: pytest.MonkeyPatch, program: Path, command: str
):
    """With the program's whole path, which sudo would not find, and the options that were typed."""
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(sys, "argv", ["chefbotd", command, "--robot", "khan"])
    monkeypatch.setattr(commands, "_require_reachable", lambda program: None)
    typed = [command, "--robot", "khan"] if command == "install-service" else [command]
    refused = CliRunner().invoke(main, typed)
    assert refused.exit_code == Exit.FAILED
    assert f"run: sudo {program} {command} --robot khan" in refused.output


def test_a_program_in_a_home_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The unit's ProtectHome= hides it: the message names it and says what to do instead."""
    monkeypatch.setattr(commands, "HIDDEN_FROM_SERVICES", (str(tmp_path),))
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    refused = CliRunner().invoke(main, ["install-service"])
    assert refused.exit_code == Exit.FAILED
    assert f"is in {tmp_path}, which the service cannot see" in refused.output
    assert "docs/service.md" in refused.output


def test_a_robot_that_is_not_known_is_told(tmp_path: Path):
    """With those that there are."""
    refused = CliRunner().invoke(
        main, ["install-service", "--dry-run", "--root", str(tmp_path / "root"), "--robot", "hal"]
    )
    assert refused.exit_code == Exit.BAD_CONFIGURATION
    assert "khan" in refused.output


def refusal(*words: str) -> str:
    """Why install-service does not begin."""
    refused = CliRunner().invoke(main, ["install-service", "--dry-run", *words])
    assert refused.exit_code in (Exit.FAILED, 2), refused.output
    return refused.output


def test_a_folder_gets_the_path_by_which_its_own_system_finds_the_program(tmp_path: Path, program: Path):
    """That of this program within the folder, or one that is named; another's would not hold there."""
    root = tmp_path / "root"
    assert commands.program_in(root, program, None) == Path(PROGRAM)
    named = Path("/opt/pipx/venvs/chefbotd/bin/chefbotd")
    assert commands.program_in(root, program, named) == named
    assert commands.program_in(SYSTEM, program, None) == program
    elsewhere = str(tmp_path / "image")
    assert f"{program} is not in {elsewhere}, where the service would look for it" in refusal(
        "--root", elsewhere
    )
    assert "expected the whole path" in refusal("--root", elsewhere, "--program", "bin/chefbotd")
    assert "which the service cannot see" in refusal(
        "--root", elsewhere, "--program", "/home/ann/bin/chefbotd"
    )


def test_a_program_is_named_only_for_a_folder(monkeypatch: pytest.MonkeyPatch):
    """On the system that runs, the service starts the chefbotd that was typed."""
    monkeypatch.setattr(commands, "_require_reachable", lambda program: None)
    assert "--program is for --root" in refusal("--program", PROGRAM)


@pytest.mark.parametrize("has_page", [True, False])
def test_the_page_is_served_where_the_folders_own_program_can(tmp_path: Path, has_page: bool):
    """Its environment is looked at through the links within the folder, not this one."""
    root = tmp_path / "root"
    venv = root / "opt/pipx/venvs/chefbotd"
    (venv / "lib/python3.11/site-packages" / ("aiohttp" if has_page else "click")).mkdir(parents=True)
    (venv / "bin").mkdir()
    (venv / "bin/chefbotd").touch()
    (root / "usr/local/bin").mkdir(parents=True)
    (root / "usr/local/bin/chefbotd").symlink_to("/opt/pipx/venvs/chefbotd/bin/chefbotd")
    host, named = Host(root), Path("/usr/local/bin/chefbotd")
    assert plan._has_page(host, named) is has_page
    told = [step.told for step in plan.install(host, plan.InstallRequest(named))]
    assert not any("not in" in line for line in told)
    assert any("its page is off" in line for line in told) is not has_page


@pytest.mark.slow
@pytest.mark.skipif(any(shutil.which(name) is None for name in NEEDED), reason=f"needs {', '.join(NEEDED)}")
def test_the_real_commands_install_into_a_folder_and_a_second_run_changes_nothing(
    program: Path, tmp_path: Path
):
    """With systemd's own programs, in fakeroot: a user of the system, the unit enabled, everything back by --purge."""
    root = tmp_path / "root"
    (root / "etc").mkdir(parents=True)

    def chefbotd(*arguments: str) -> list[str]:
        words = [*arguments, "--root", str(root)]
        if "install-service" in arguments:
            words += ["--program", PROGRAM]
        inner = f"from chefbotd.cli.programs.chefbotd import main; main({words})"
        state = tmp_path / "fakeroot"
        state.touch()
        kept = ("fakeroot", "-i", str(state), "-s", str(state), sys.executable, "-c", inner)
        done = subprocess.run(kept, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    planned = chefbotd("install-service", "--dry-run")
    assert chefbotd("install-service") == planned
    assert any(line.startswith("chefbotd:") for line in (root / "etc/passwd").read_text().splitlines())
    assert "dialout" in (root / "etc/group").read_text()
    assert (root / "etc/systemd/system/multi-user.target.wants/chefbotd.service").is_symlink()
    unit = (root / "etc/systemd/system/chefbotd.service").read_text()
    assert f"\nExecStart={PROGRAM} run --config /etc/chefbotd/chefbot.toml\n" in unit
    assert str(root) not in unit
    program.parent.mkdir(parents=True)
    program.touch()
    assert all(line.endswith("unchanged") for line in chefbotd("install-service"))
    chefbotd("uninstall-service")
    assert not (root / "etc/systemd/system/chefbotd.service").exists()
    assert (root / "etc/chefbotd/tokens").exists()
