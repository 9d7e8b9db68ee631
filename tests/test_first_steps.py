"""What a newcomer reads first: README, CONTRIBUTING and `make help` name only what there is."""

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click
import pytest

from chefbotd.cli.programs import chefbotctl, chefbotd
from chefbotd.transport.ports import reserve_port
from tests.waiting import PATIENCE_S

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


def test_the_examples_list_every_folder_and_program() -> None:
    """A folder, and each file that is a program to be run, has its row."""
    page = (ROOT / "examples" / "README.md").read_text(encoding="utf-8")
    folders = {path.parent.name for path in (ROOT / "examples").glob("*/*.py")}
    programs = {
        path.name
        for path in (ROOT / "examples").glob("*.py")
        if '"__main__"' in path.read_text(encoding="utf-8")
    }
    for name in {*folders, *programs, "notebook"}:
        assert re.search(rf"\]\({name}[)/]", page), name


def test_the_file_that_readme_runs_with_is_the_one_that_new_robot_writes() -> None:
    """No command names a file that nobody has made."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shell = " ".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL))
    assert "chefbotctl new-robot my-robot.toml " in shell
    assert set(re.findall(r"\S+\.toml", re.sub(r"#.*", "", shell))) == {"my-robot.toml"}


def test_readme_names_only_commands_and_options_that_there_are() -> None:
    """In every block for a shell, with a robot too."""
    programs = {"chefbotd": chefbotd.main, "chefbotctl": chefbotctl.main}
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```(?:sh|console)\n(.*?)```", text, re.DOTALL)
    lines = [line.partition("#")[0] for block in blocks for line in block.splitlines()]
    named = [
        found for line in lines for found in re.findall(r"(?:^|[ /])(chefbotd|chefbotctl) ([a-z].*)", line)
    ]
    assert len(named) > 20
    for program, said in named:
        command: click.Command = programs[program]
        words = said.split()
        while isinstance(command, click.Group):
            found = command.get_command(click.Context(command), words.pop(0))
            assert found is not None, (program, said)
            command = found
        known = {option for parameter in command.params for option in parameter.opts}
        assert {word for word in words if word.startswith("--")} <= known, (program, said)


@contextmanager
def daemon(words: list[str], port: int, log: Path) -> Iterator[None]:
    """The daemon of README's first line, on a port that is free; it is ended by Ctrl-C."""
    where = ["--listen", f"127.0.0.1:{port}"]
    environment = {**os.environ, "XDG_STATE_HOME": str(log.parent), "CHEFBOTD_PAGE__PORT": "0"}
    with (
        log.open("wb") as sink,
        subprocess.Popen([*words, *where], stderr=sink, env=environment) as process,
    ):
        try:
            until_s = time.monotonic() + PATIENCE_S
            while '"mode": "armed"' not in log.read_text() or "link opened" not in log.read_text():
                assert time.monotonic() < until_s, log.read_text()
                time.sleep(0.05)
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(PATIENCE_S)


@pytest.mark.slow
@pytest.mark.realtime
def test_what_readme_says_of_driving_recording_and_replaying_works(tmp_path: Path) -> None:
    """Each line of it is run as it stands, but for the ports and the folder of the user's state."""
    pytest.importorskip("mcap")
    pytest.importorskip("matplotlib")
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (block,) = (each for each in re.findall(r"```sh\n(.*?)```", text, re.DOTALL) if "--record" in each)
    lines = [shlex.split(line, comments=True) for line in block.splitlines()]
    port = reserve_port()
    here = tmp_path

    def run(words: list[str]) -> str:
        program = str(Path(sys.executable).with_name(words[0]))
        filled = [str(path) for word in words[1:] for path in ([*here.glob(word)] if "*" in word else [word])]
        environment = {
            **os.environ,
            "CHEFBOTCTL_CONNECT": f"127.0.0.1:{port}",
            "XDG_STATE_HOME": str(tmp_path),
        }
        done = subprocess.run(
            [program, *filled],
            cwd=here,
            env=environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
        assert done.returncode == 0, done.stderr + done.stdout
        return done.stdout

    start, drive, folder, info, plot, replay, serve = lines
    program = str(Path(sys.executable).with_name(start[0]))
    with daemon([program, *start[1:]], port, tmp_path / "log"):
        assert "Moved" in run(drive)
    assert folder[1].startswith("~/.local/state/")
    here = tmp_path / folder[1].removeprefix("~/.local/state/")
    assert "robot chefbot" in run(info)
    run(plot)
    assert [path.suffix for path in sorted(here.glob("auto_*"))] == [".mcap", ".png"]
    assert "are the same, bit for bit." in run(replay)
    served = run([*serve, "--listen", f"127.0.0.1:{port}", "--rate", "20", "--json"])
    assert json.loads(served)["exact"]
