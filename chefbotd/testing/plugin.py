"""The pytest plugin ``chefbotd``: fixtures for testing code that talks to the robot, without a robot.

It is loaded by pytest itself, so everything is imported where it is used.
"""

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from chefbotd.testing.board import ScriptedBoard
    from chefbotd.testing.transport import FakeSerialDevice


@pytest.fixture
def serial_device() -> "FakeSerialDevice":
    """A serial device in memory, plugged in."""
    from chefbotd.testing.transport import FakeSerialDevice

    return FakeSerialDevice()


@pytest.fixture
def scripted_board(serial_device: "FakeSerialDevice") -> "ScriptedBoard":
    """A classic board at the other end of ``serial_device``."""
    from chefbotd.testing.board import ScriptedBoard

    return ScriptedBoard(serial_device)
