"""The stop that `chefbotd run` writes before it imports what it runs by."""

import asyncio
import fcntl
import os
import termios
import tty
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from chefbotd.link import board_writer, early_stop
from chefbotd.link.early_stop import DEFAULTS, STOPS, hand_over, read_link, stop_early
from chefbotd.link.port import LinkParameters, open_port
from chefbotd.link.wires import stop_line
from chefbotd.packaged import packaged_folder
from chefbotd.settings import load
from chefbotd.settings.model import RobotParameters
from firmware_protocol.codec import VARIANTS


@pytest.fixture
def board() -> Iterator[tuple[int, str]]:
    """A board's end of a line that does not wait, and the path of the daemon's end."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    yield ours, os.ttyname(theirs)
    with hand_over(""):
        pass
    for descriptor in (ours, theirs):
        os.close(descriptor)


def open_descriptors() -> set[str]:
    """The numbers of this process's descriptors."""
    return {path.name for path in Path("/proc/self/fd").iterdir()}


def heard(descriptor: int) -> bytes:
    """What the board has been sent."""
    try:
        return os.read(descriptor, 4096)
    except BlockingIOError:
        return b""


def is_locked(device: str) -> bool:
    """Whether a program that opens the device is refused its lock."""
    descriptor = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False


def test_its_copies_are_those_of_the_daemon() -> None:
    """The line that stops each wire, how often it is written, and every default."""
    assert {wire: stop_line(wire) for wire in VARIANTS} == STOPS
    assert early_stop.FIRST_STOPS == board_writer.FIRST_STOPS
    link = LinkParameters()
    assert DEFAULTS["link"] == {key: getattr(link, key) for key in DEFAULTS["link"]}
    assert DEFAULTS["robot"] == {"wire": RobotParameters.model_fields["wire"].default}


OWN = """
extends = "khan"
[link]
device = "/dev/own"
dtr = false
hang_up_on_close = true
"""


@pytest.mark.parametrize("config", [*sorted(p.stem for p in packaged_folder().glob("*.toml")), OWN, None])
@pytest.mark.parametrize("port", [[], ["--port", "/dev/ttyS9"], ["--port=/dev/ttyS9"]])
@pytest.mark.parametrize(
    "environment",
    [
        {},
        {"CHEFBOTD_LINK__DEVICE": "/dev/ttyUSB7", "CHEFBOTD_LINK__BAUD": "57600"},
        {"CHEFBOTD_LINK__RTS": "false", "CHEFBOTD_link__EXCLUSIVE": "false", "CHEFBOTD_LOG__LEVEL": "debug"},
    ],
)
def test_it_reads_what_the_daemon_reads(
    config: str | None,
    port: list[str],
    environment: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each packaged robot, one that extends another, the default; with the environment and --port over them."""
    for name, text in environment.items():
        monkeypatch.setenv(name, text)
    if config == OWN:
        (tmp_path / "own.toml").write_text(OWN, encoding="utf-8")
        config = str(tmp_path / "own.toml")
    given = [] if config is None else ["--config", config]
    path = None if config is None else Path(config) if "/" in config else packaged_folder() / f"{config}.toml"
    settings = load(path, overrides={"link.device": "/dev/ttyS9"} if port else {})
    values = read_link(["run", *given, "--listen=127.0.0.1:0", "--page", *port], environment)
    assert values == {
        **{key: getattr(settings.link, key) for key in DEFAULTS["link"]},
        "wire": settings.robot.wire,
    }


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["check-config"],
        ["run", "--sim"],
        ["run", "--help"],
        ["run", "--port"],
        ["run", "--page=1"],
        ["run", "chefbot"],
        ["run", "--config", "no_such_robot"],
        ["run", "--config", "{folder}"],
        ["run", "--config", "{folder}/fifo.toml"],
        ["run", "--config", "{folder}/broken.toml"],
        ["run", "--config", "{folder}/types.toml"],
        ["run", "--config", "{folder}/section.toml"],
        ["run", "--config", "{folder}/circle.toml"],
        ["run", "--config", "{folder}/outside.toml"],
        ["run", "--config", "{folder}/latin1.toml"],
    ],
)
def test_what_is_not_plain_is_left_to_the_daemon(
    arguments: list[str], tmp_path: Path, board: tuple[int, str]
) -> None:
    """Another command, a simulated robot, an option or a file that is not as expected: nothing is written or raised."""
    device = board[1]
    os.mkfifo(tmp_path / "fifo.toml")
    files = {
        "broken": f'[link]\ndevice = "{device}',
        "types": f'[link]\ndevice = "{device}"\nbaud = "fast"',
        "section": f'link = "{device}"',
        "circle": f'extends = 7\n[link]\ndevice = "{device}"',
        "outside": f'extends = "../x"\n[link]\ndevice = "{device}"',
    }
    for name, text in files.items():
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    (tmp_path / "latin1.toml").write_bytes(f'[link]\ndevice = "{device}"  # \xe9'.encode("latin-1"))
    given = [argument.format(folder=tmp_path) for argument in arguments]
    stop_early(given, {"CHEFBOTD_LINK__DEVICE": device} if "--config" not in arguments else {})
    assert (heard(board[0]), is_locked(device)) == (b"", False)


@pytest.mark.parametrize(
    "environment",
    [
        {"CHEFBOTD_LINK": "{device = '/dev/x'}"},
        {"CHEFBOTD_LINK__EXCLUSIVE": "false"},
        {"CHEFBOTD_LINK__BAUD": "12345"},
        {"CHEFBOTD_LINK__DTR": "perhaps"},
        {"CHEFBOTD_ROBOT__WIRE": "morse"},
    ],
)
def test_a_variable_that_it_cannot_follow_leaves_all_to_the_daemon(
    environment: Mapping[str, str], board: tuple[int, str]
) -> None:
    """A whole section, a port that is shared, a speed of no standard, a wrong type, an unknown wire."""
    stop_early(["run", "--port", board[1]], environment)
    assert (heard(board[0]), is_locked(board[1])) == (b"", False)


def test_the_board_hears_two_stops_and_the_port_stays_locked_until_it_is_handed_over(
    board: tuple[int, str],
) -> None:
    """KHAN's four wheels; then a second program may have the lock, and the descriptor is closed."""
    before = open_descriptors()
    stop_early(["run", "--config", "khan", "--port", board[1]], {})
    assert heard(board[0]) == b"s 0 0 0 0\rs 0 0 0 0\r"
    assert is_locked(board[1])
    with hand_over(board[1]):
        assert not is_locked(board[1])
    assert open_descriptors() == before


def test_the_daemon_opens_the_port_that_it_holds(board: tuple[int, str]) -> None:
    """Its own lock does not keep it out, and then the daemon has the lock."""

    async def scene() -> None:
        stop_early(["run", "--port", board[1]], {})
        transport = await open_port(LinkParameters(device=board[1]), asyncio.Protocol())
        assert is_locked(board[1])
        transport.abort()

    asyncio.run(scene())


def test_a_failed_opening_leaves_nothing_open(board: tuple[int, str]) -> None:
    """The daemon tries again by itself; nobody is kept out meanwhile."""
    stop_early(["run", "--port", board[1]], {})
    with pytest.raises(OSError, match="no such device"), hand_over(board[1]):
        raise OSError("no such device")
    assert not is_locked(board[1])


def test_another_device_is_opened_beside_it_and_the_first_one_is_given_up(board: tuple[int, str]) -> None:
    """Where the daemon reads another device than the first stop did."""
    stop_early(["run", "--port", board[1]], {})
    with hand_over("/dev/other"):
        assert not is_locked(board[1])


def test_a_port_in_use_gets_nothing(board: tuple[int, str]) -> None:
    """A second daemon, started by mistake, does not stop the robot of the first, nor change its port."""
    descriptor = os.open(board[1], os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(descriptor, fcntl.LOCK_EX)
    settings = termios.tcgetattr(descriptor)
    stop_early(["run", "--port", board[1]], {"CHEFBOTD_LINK__BAUD": "9600"})
    assert heard(board[0]) == b""
    assert termios.tcgetattr(descriptor) == settings
    os.close(descriptor)


@pytest.mark.parametrize("kind", ["file", "fifo", "missing", "socket"])
def test_what_is_no_terminal_gets_nothing(kind: str, tmp_path: Path) -> None:
    """A file stays as it was; nothing waits for a FIFO's other end, nor for a socket."""
    device = tmp_path / "device"
    if kind == "file":
        device.write_bytes(b"precious")
    elif kind == "fifo":
        os.mkfifo(device)
    before = open_descriptors()
    stop_early(["run", "--port", "socket://127.0.0.1:9" if kind == "socket" else str(device)], {})
    assert open_descriptors() == before
    assert kind != "file" or device.read_bytes() == b"precious"


def test_the_port_is_set_up_as_the_daemon_sets_it_up(board: tuple[int, str]) -> None:
    """Raw, the speed and what happens to DTR at the end: the daemon's opening changes nothing that the board sees."""

    def settings() -> list[object]:
        descriptor = os.open(board[1], os.O_RDWR | os.O_NOCTTY)
        try:
            return termios.tcgetattr(descriptor)[:6]
        finally:
            os.close(descriptor)

    async def scene() -> list[object]:
        transport = await open_port(LinkParameters(device=board[1], baud=57600), asyncio.Protocol())
        opened = settings()
        transport.abort()
        return opened

    stop_early(["run", "--port", board[1]], {"CHEFBOTD_LINK__BAUD": "57600"})
    first = settings()
    assert asyncio.run(scene()) == first
    assert first[4:6] == [termios.B57600] * 2
