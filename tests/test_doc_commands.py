"""Every command in README and the documentation: it is there, and it runs, or somebody else tries it."""

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
from tests.core_install import tried
from tests.doc_commands import NOT_RUN, PAGES, ROOT, Line, commands_of, runnable
from tests.waiting import PATIENCE_S

if not (ROOT / "CONTRIBUTING.md").exists():
    pytest.skip("only the sources have the pages", allow_module_level=True)

PROGRAMS: dict[str, click.Command] = {"chefbotd": chefbotd.main, "chefbotctl": chefbotctl.main}
OF_ADDONS = ("shell", "sweep")
SHELL = re.compile(r"^(\$ |sudo |make |pip |pipx |chefbotd |chefbotctl |\.venv/bin/)")
FLAGS = re.MULTILINE | re.DOTALL
LINES = [line for page in PAGES for line in commands_of(page)]


def named(line: Line) -> Iterator[tuple[str, list[str]]]:
    """Each call of chefbotd and chefbotctl in a line, with its words."""
    for part in re.split(r"&&|\||;|&(?:\s|$)", line.text):
        words = shlex.split(part.replace("$(", "").replace(")", ""))
        while words and (words[0] == "sudo" or "=" in words[0]):
            words.pop(0)
        if words and words[0] in PROGRAMS:
            yield words[0], words[1:]


def leaf(program: str, words: list[str]) -> tuple[click.Command, list[str], list[str]]:
    """The command that the words name, its own words, and the names on the way to it."""
    command, rest, names = PROGRAMS[program], list(words), [program]
    while isinstance(command, click.Group):
        _, left, _ = command.make_parser(click.Context(command)).parse_args(rest)
        if not left:  # an option of the program itself, such as --version
            return command, [], names
        found = command.get_command(click.Context(command), left[0])
        assert found is not None, words
        command, rest, names = found, left[1:], [*names, left[0]]
    return command, rest, names


def test_commands_stand_in_blocks_for_a_shell() -> None:
    """None is indented only: this test would not see it, nor would a reader's copy button."""
    for page in PAGES:
        text = re.sub(r"^```.*?^```$", "", (ROOT / page).read_text(encoding="utf-8"), flags=FLAGS)
        stray = [line for line in text.splitlines() if line.startswith("    ") and SHELL.match(line.strip())]
        assert not stray, page
    assert len(LINES) > 150


@pytest.mark.parametrize("page", [page for page in PAGES if commands_of(page)])
def test_every_command_and_option_is_there(page: str) -> None:
    """As click reads them: no command, option or argument that the program does not know, none that it lacks."""
    for line in commands_of(page):
        for program, words in named(line):
            command, rest, names = leaf(program, words)
            if names[-1] in OF_ADDONS:
                continue
            context = click.Context(command)
            values, left, _ = command.make_parser(context).parse_args(list(rest))
            assert not left, line
            for parameter in command.params:
                if isinstance(parameter, click.Argument) and parameter.required:
                    assert values.get(parameter.name or ""), (line, parameter.name)


def targets_in(makefile: Path) -> set[str]:
    """The targets that a Makefile defines or declares."""
    text = makefile.read_text(encoding="utf-8")
    declared = re.findall(r"^\.PHONY: (.+)$", text, re.MULTILINE)
    return {*re.findall(r"^([a-z][\w-]*):(?!=)", text, re.MULTILINE), *" ".join(declared).split()}


def test_commands_are_called_in_one_way() -> None:
    """As where `.venv` is activated, which stands in the same pages: no path of the environment before them."""
    for page in PAGES:
        for block in re.findall(
            r"^```(?:sh|console)\n(.*?)^```$", (ROOT / page).read_text(encoding="utf-8"), FLAGS
        ):
            assert not re.search(r"\.venv/bin/(?!activate)", block), page


def test_every_target_is_there() -> None:
    """Of the Makefile, and of the firmware's."""
    targets = {folder: targets_in(ROOT / folder / "Makefile") for folder in (".", "firmware")}
    for line in LINES:
        if re.match(r"make\b", line.text):
            folder = "firmware" if line.page.startswith("firmware") and "-C .." not in line.text else "."
            words = re.sub(r"-C \.\.|[A-Z]+=\S+|&&.*", "", line.text).split()[1:]
            assert set(words) <= targets[folder], line


def test_what_is_not_run_has_a_reason_and_each_reason_a_line() -> None:
    """No reason outlives its line."""
    for pattern in NOT_RUN:
        assert any(re.search(pattern, line.text) for line in LINES), pattern


def test_every_command_is_tried_in_a_core_install_too() -> None:
    """``tests.core_install`` runs them without extras: each ends well, or with what adds the extra."""
    without_words = {" ".join(word for word in row.split() if not word.startswith("-")) for row in tried()}
    for line in LINES:
        for program, words in named(line):
            names = " ".join(leaf(program, words)[2])
            if " " not in names:
                continue
            assert any(row == names or row.startswith(f"{names} ") for row in without_words), (line, names)


PRELUDE = """set -euo pipefail
chefbotd() {
  if [ "$1" != run ]; then command chefbotd "$@"; return; fi
  command chefbotd "$@" 2> run.log & daemon=$!
  for _ in $(seq 1000); do grep -q 'listening' run.log && break; sleep 0.1; done
  grep -q 'listening' run.log || { cat run.log; return 1; }
  kill -INT $daemon; wait $daemon
}
nc() { command python -c 'import os, socket
print(socket.create_connection(("127.0.0.1", int(os.environ["DOC_TEST_PORT"]))).recv(4096).decode())'; }
"""
"""In a page's blocks ``chefbotd run`` goes on for ever: here it is ended by Ctrl-C when it listens."""


NAMED_ROBOT = re.compile(r"chefbotd run --sim --config (\w+)")


def robot_of(page: str) -> str:
    """The simulated robot that a page's first lines tell its reader to start; ChefBot without a word about it."""
    named = NAMED_ROBOT.search("".join((ROOT / page).read_text(encoding="utf-8").splitlines(True)[:12]))
    return named[1] if named else "chefbot"


@contextmanager
def simulated(robot: str, folder: Path, environment: dict[str, str], port: int) -> Iterator[None]:
    """The simulated robot that a page's commands ask, on a port of its own."""
    program = shutil.which("chefbotd", path=environment["PATH"]) or "chefbotd"
    with (folder / "daemon.log").open("wb") as log:
        process = subprocess.Popen(
            [program, "run", "--sim", "--config", robot, "--listen", f"127.0.0.1:{port}"],
            env=environment,
            stderr=log,
        )
    try:
        ends_s = time.monotonic() + PATIENCE_S
        while '"mode": "armed"' not in (text := (folder / "daemon.log").read_text()):
            assert process.poll() is None, text
            assert time.monotonic() < ends_s, text
            time.sleep(0.05)
        yield
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE_S)


@pytest.mark.slow
@pytest.mark.realtime
@pytest.mark.parametrize("page", [page for page in PAGES if runnable(page)])
def test_pages_commands_run(page: str, tmp_path: Path) -> None:
    """Each block of a page after the other, as it stands, in an empty home beside a simulated robot."""
    for package in ("mcap", "matplotlib", "aiohttp"):
        pytest.importorskip(package)
    port, home = reserve_port(), tmp_path / "home"
    home.mkdir()
    binaries = Path(sys.executable).parent
    (home / ".venv").symlink_to(binaries.parent)
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "CHEFBOT"))},
        "HOME": str(home),
        "PATH": f"{binaries}:{os.environ['PATH']}",
        "CHEFBOTCTL_CONNECT": f"127.0.0.1:{port}",
        "DOC_TEST_PORT": str(port),
        "CHEFBOTD_PAGE__PORT": "0",
    }
    with simulated(robot_of(page), tmp_path, environment, port):
        for block in runnable(page):
            script = PRELUDE + "\n".join(line.text for line in block)
            asked = {**environment, "CHEFBOTD_API__PORT": "0"}
            done = subprocess.run(
                ["bash", "-c", script],
                cwd=home,
                env=asked,
                capture_output=True,
                text=True,
                timeout=3 * PATIENCE_S,
                check=False,
            )
            assert done.returncode == 0, f"{[line.text for line in block]}\n{done.stdout}{done.stderr}"


def test_who_is_said_to_try_a_command_is_there() -> None:
    """Each folder and file of tests that a reason names."""
    for reason in NOT_RUN.values():
        for path in re.findall(r"tests/[\w/.]+\w", reason):
            assert (ROOT / path).exists(), reason
