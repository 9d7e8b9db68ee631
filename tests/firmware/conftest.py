"""All tests of this folder have the marker ``firmware``."""

from pathlib import Path

import pytest

from tests.firmware import host, tools

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark those of this folder."""
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.firmware)


@pytest.fixture
def board() -> host.Board:
    """The host build, just powered on at time 0, its banner sent."""
    tools.need("gcc", "make")
    return host.Board()
