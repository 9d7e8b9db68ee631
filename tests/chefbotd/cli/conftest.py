"""A fake daemon, and the program chefbotctl talking to it on a virtual clock."""

from collections.abc import Callable, Iterator

import pytest
from click.testing import CliRunner, Result

from chefbotd.cli.programs.chefbotctl import main
from tests.chefbotd.cli.fake_daemon import FakeDaemon

Control = Callable[..., Result]


@pytest.fixture
def daemon() -> Iterator[FakeDaemon]:
    """A daemon that serves while ``control`` runs one command."""
    fake = FakeDaemon()
    yield fake
    fake.close()


@pytest.fixture
def control(daemon: FakeDaemon) -> Control:
    """Runs ``chefbotctl --connect <daemon> ARGS...`` to its end."""

    def run(*args: str) -> Result:
        where = f"--connect=127.0.0.1:{daemon.port}"
        return CliRunner().invoke(main, [where, *args], obj=daemon.run)

    return run
