"""Descriptions for tests: those that were written by hand, one of one's own, and what a daemon serves."""

from pathlib import Path

from chefbotd.clock import run_virtual
from chefbotd.settings import Settings
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice
from tests.robot_files import full

WRITTEN_BY_HAND = Path(__file__).parents[2] / "vectors" / "urdf"


def written(robot: str) -> Path:
    """A description of the robot that was written by hand, from the published numbers."""
    return WRITTEN_BY_HAND / f"{robot}.urdf"


def own(folder: Path, urdf: str | None, *, change: tuple[str, str] = ("", "")) -> Path:
    """A copy of KHAN's configuration that names a description beside it."""
    path = folder / "robot.toml"
    text = full("khan").read_text().replace('# description = "my.urdf"', 'description = "my.urdf"', 1)
    assert change[0] in text
    path.write_text(text.replace(*change, 1))
    if urdf is not None:
        (folder / "my.urdf").write_text(urdf)
    return path


def served(settings: Settings) -> str | None:
    """What a daemon with this configuration answers to ``get_description``."""

    async def scenario() -> str | None:
        async with running_daemon(FakeSerialDevice(), settings) as client:
            urdf: str | None = (await client.call("get_description"))["urdf"]
            return urdf

    return run_virtual(scenario())
