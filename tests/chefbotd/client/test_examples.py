"""Every Python program of README, docs/client.md and docs/api.md runs as it stands against a simulated robot."""

import contextlib
import io
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from chefbotd.client import CallError
from chefbotd.rpc.jsonrpc import ErrorKind
from tests.chefbotd.client.real_time import simulated_daemon

ROOT = Path(__file__).parents[3]
PAGES = ("README.md", "docs/client.md", "docs/api.md")
pytestmark = pytest.mark.skipif(
    not (ROOT / "README.md").exists(), reason="the documentation is not part of an installed package"
)


def programs() -> list[tuple[str, str]]:
    """Each fenced block of Python that uses the client, with where it is."""
    found = []
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8") if (ROOT / page).exists() else ""
        blocks = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
        found += [(f"{page}-{i}", block) for i, block in enumerate(blocks) if "chefbotd.client" in block]
    return found


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """A simulated daemon's."""
    with simulated_daemon() as port:
        yield port


def run(program: str, port: int) -> str:
    """What the program prints; it connects to our port in place of the default one.

    It runs again where a busy computer had the daemon stand still while the robot drove: then a command is refused.
    """
    there = re.sub(
        r'Client\.connect\((?:"127\.0\.0\.1", 7333)?', f'Client.connect("127.0.0.1", {port}, ', program
    )
    assert there != program, "it connects nowhere"
    while True:
        said = io.StringIO()
        try:
            with contextlib.redirect_stdout(said):
                exec(compile(there, "example", "exec"), {"__name__": "__main__"})
        except CallError as refused:
            if refused.kind != ErrorKind.TOO_OLD:
                raise
        else:
            return said.getvalue()


@pytest.mark.parametrize("program", [pytest.param(text, id=name) for name, text in programs()])
def test_a_program_can_be_pasted(program: str, port: int) -> None:
    """It ends by itself without an error, and says something with a number."""
    assert re.search(r"\d\.\d", run(program, port))


def test_every_page_has_programs() -> None:
    """None of the pages is passed over."""
    assert {name.rpartition("-")[0] for name, _ in programs()} == set(PAGES)


def test_the_first_program_drives(port: int) -> None:
    """README's program goes 0.2 m/s for 1.5 s: 0.3 m, and its ramps; on a busy computer less, as the robot brakes."""
    (_, first), *_ = programs()
    went = re.search(r"drove ([\d.]+) m", run(first, port))
    assert went is not None
    assert 0.02 < float(went[1]) < 0.35
