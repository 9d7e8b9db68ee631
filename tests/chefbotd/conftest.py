"""A fake daemon with the program chefbotctl talking to it on a virtual clock, and a configuration to spoil."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner, Result

from chefbotd.cli.programs.chefbotctl import main
from tests.robot_files import full

if TYPE_CHECKING:
    from tests.chefbotd.cli.fake_daemon import FakeDaemon

Control = Callable[..., Result]


@pytest.fixture
def daemon() -> "Iterator[FakeDaemon]":
    """A daemon that serves while ``control`` runs one command."""
    # It has every component: a test that does not ask for it needs none.
    from tests.chefbotd.cli.fake_daemon import FakeDaemon

    fake = FakeDaemon()
    yield fake
    fake.close()


@pytest.fixture
def control(daemon: "FakeDaemon") -> Control:
    """Runs ``chefbotctl --connect <daemon> ARGS...`` to its end."""

    def run(*args: str) -> Result:
        where = f"--connect=127.0.0.1:{daemon.port}"
        return CliRunner().invoke(main, [where, *args], obj=daemon.run)

    return run


@pytest.fixture
def chefbot(tmp_path: Path) -> Path:
    """A copy of the packaged configuration to spoil."""
    copy = tmp_path / "robot.toml"
    copy.write_text(full("chefbot").read_text())
    return copy
