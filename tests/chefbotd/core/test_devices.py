"""What may stand where a serial device is configured."""

import pytest
from pydantic import ValidationError

from chefbotd.core.parameters import check_device
from chefbotd.link.port import LinkParameters
from chefbotd.sensing.lidar import LidarModel, LidarParameters


@pytest.mark.parametrize(
    "device",
    [
        "/dev/ttyACM0",
        "/dev/serial/by-id/usb-Texas:Instruments-if00",
        "socket://127.0.0.1:7000",
        "socket://robot.local:65535",
        "socket://[::1]:1",
    ],
)
def test_paths_and_addresses_are_taken(device: str) -> None:
    """As they are."""
    assert check_device(device, "/dev/ttyACM0") == device


@pytest.mark.parametrize(
    ("device", "told"),
    [
        ("socket://127.0.0.1", "socket://host:port"),
        ("socket://:7000", "socket://host:port"),
        ("socket://127.0.0.1:", "socket://host:port"),
        ("socket://127.0.0.1:http", "socket://host:port"),
        ("socket://::1:7000", "socket://host:port"),
        ("socket://127.0.0.1:7000/path", "socket://host:port"),
        ("socket://127.0.0.1:0", "a port from 1 to 65535, got 0"),
        ("socket://127.0.0.1:65536", "a port from 1 to 65535, got 65536"),
        ("loop://", "socket://host:port"),
        ("rfc2217://127.0.0.1:7000", "socket://host:port"),
    ],
)
def test_an_address_that_cannot_be_opened_is_refused(device: str, told: str) -> None:
    """For the board and for a lidar, with the value and what was expected."""
    with pytest.raises(ValidationError) as of_board:
        LinkParameters(device=device)
    with pytest.raises(ValidationError) as of_lidar:
        LidarParameters(model=LidarModel.LD19, device=device)
    for error in (of_board, of_lidar):
        assert told in str(error.value)
        assert device in str(error.value)
