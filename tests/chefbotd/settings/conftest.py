"""What the tests of the configuration share."""

from pathlib import Path

import pytest

from chefbotd.settings import packaged


@pytest.fixture
def chefbot(tmp_path: Path) -> Path:
    """A copy of the packaged configuration to spoil."""
    copy = tmp_path / "robot.toml"
    copy.write_text(packaged("chefbot").read_text())
    return copy
