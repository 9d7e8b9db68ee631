"""Files in folders that others can write: opened as what they should be, or refused at once."""

import os
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from chefbotd import storage
from chefbotd.components.localization.pose_file import PoseOnDisk
from chefbotd.components.maps.storage.manifest import MANIFEST, NotAManifest
from chefbotd.components.maps.storage.places import PLACES, parse_places
from chefbotd.components.maps.storage.store import CURRENT, SUFFIX, MapStore
from chefbotd.components.maps.storage.versions import check
from chefbotd.components.navigation.algorithms.grid import GridFrame
from chefbotd.components.navigation.algorithms.zones import keep_out_cells, require_affordable
from chefbotd.components.recording.folder import RecordingDisk, RecordingFolder
from chefbotd.components.recording.parameters import RecordingParameters
from chefbotd.components.recording.reader import RecordingReader, UnreadableRecording
from chefbotd.components.zones.zone_file import Zone, Zones, parse_zones
from chefbotd.core.commands import Refused
from chefbotd.core.geometry import Pose2D
from chefbotd.process.latch_file import LatchFile
from chefbotd.rpc.access import AccessError, load_guard
from chefbotd.rpc.parameters import ApiParameters
from chefbotd.safety.gate import GateState, Mode
from chefbotd.storage import NotRegular, create_file, explain, read_file, replace_file


def link_to_zero(path: Path) -> None:
    """A file without end."""
    path.symlink_to("/dev/zero")


def fifo(path: Path) -> None:
    """A pipe that nobody writes to."""
    os.mkfifo(path)


def folder(path: Path) -> None:
    """A folder of that name."""
    path.mkdir()


def unix_socket(path: Path) -> None:
    """A socket."""
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))


def huge(path: Path) -> None:
    """A terabyte, of which nothing is on the disk."""
    with path.open("wb") as file:
        file.truncate(1 << 40)


def nested(path: Path) -> None:
    """Lists in lists, 100,000 deep."""
    path.write_bytes(b"[" * 100_000 + b"]" * 100_000)


def nested_objects(path: Path) -> None:
    """Objects in objects, of YAML and of JSON."""
    path.write_bytes(b'{"a":' * 20_000 + b"1" + b"}" * 20_000)


Make = Callable[[Path], None]
NOT_REGULAR = [link_to_zero, fifo, folder, unix_socket]
ALL = pytest.mark.parametrize("make", [*NOT_REGULAR, huge, nested, nested_objects])


@contextmanager
def at_once() -> Iterator[None]:
    """Fail, and not hang, where something waits: the alarm ends a system call that does."""

    def fail(*_: object) -> None:
        raise AssertionError("it waits")

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(60)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("make", NOT_REGULAR)
def test_what_is_no_regular_file_is_neither_read_nor_written(tmp_path: Path, make: Make) -> None:
    """With a reason in words; nothing waits for the other end of a pipe."""
    path = tmp_path / "file"
    make(path)
    with at_once():
        with pytest.raises(OSError) as caught:  # noqa: PT011 - any of them
            read_file(path, 100)
        assert isinstance(caught.value, NotRegular | IsADirectoryError) or caught.value.errno
        assert explain(caught.value)
        with pytest.raises(OSError):  # noqa: PT011
            create_file(path)


def test_a_regular_file_is_read_up_to_its_bound(tmp_path: Path) -> None:
    """And not a byte more."""
    path = tmp_path / "file"
    with create_file(path) as file:
        file.write(b"12345")
    assert read_file(path, 5) == b"12345"
    with pytest.raises(OSError, match="larger than 4 bytes") as caught:
        read_file(path, 4)
    assert explain(caught.value) == "the file is too large"


@ALL
def test_places(tmp_path: Path, make: Make) -> None:
    """The map's places are refused as unreadable."""
    own = tmp_path / f"hall{SUFFIX}"
    (own / "v000001").mkdir(parents=True)
    make(own / PLACES)
    with at_once(), pytest.raises(Refused):
        parse_places(MapStore(tmp_path, 1).read_beside("hall", PLACES), "hall")


@ALL
def test_a_manifest(tmp_path: Path, make: Make) -> None:
    """A version is damaged, and the others stay usable."""
    make(tmp_path / MANIFEST)
    with at_once(), pytest.raises((NotAManifest, OSError)):
        check(1, tmp_path)


@ALL
def test_a_saved_pose_and_the_map_in_use(tmp_path: Path, make: Make) -> None:
    """As good as none."""
    make(tmp_path / "pose.json")
    make(tmp_path / CURRENT)
    with at_once():
        assert PoseOnDisk(tmp_path / "pose.json").read() is None
        assert MapStore(tmp_path, 1).current() is None


@ALL
def test_the_latch(tmp_path: Path, make: Make) -> None:
    """The daemon starts disarmed; a file of such a kind where it writes is said, and not waited for."""
    path = tmp_path / "robot.json"
    make(path)
    make(path.with_suffix(".new"))
    with at_once():
        latch = LatchFile(path)
        assert latch.recall().mode is not Mode.ARMED
        latch.keep(GateState())


@ALL
def test_the_token_file(tmp_path: Path, make: Make) -> None:
    """The daemon does not start, and says why."""
    path = tmp_path / "tokens"
    make(path)
    if make is not link_to_zero:
        path.chmod(0o600)
    with at_once(), pytest.raises(AccessError):
        load_guard(ApiParameters(token_file=path), {})


@pytest.mark.parametrize("make", NOT_REGULAR)
def test_certificate_and_key(tmp_path: Path, make: Make) -> None:
    """OpenSSL would wait for a pipe."""
    for name in ("cert.pem", "key.pem"):
        make(tmp_path / name)
    parameters = ApiParameters(tls_certificate=tmp_path / "cert.pem", tls_key=tmp_path / "key.pem")
    with at_once(), pytest.raises(AccessError, match="TLS with"):
        load_guard(parameters, {})


@pytest.mark.parametrize("make", NOT_REGULAR)
def test_recordings(tmp_path: Path, make: Make) -> None:
    """One such name spoils the list of none of the others, and cannot be opened; so does a link that leads nowhere."""
    (tmp_path / "good.mcap").write_bytes(b"something")
    (tmp_path / "lost.mcap").symlink_to(tmp_path / "nowhere")
    make(tmp_path / "bad.mcap")
    recordings = RecordingFolder(RecordingParameters(), tmp_path, RecordingDisk())
    with at_once():
        assert [row.file for row in recordings.list_files(None)] == ["good.mcap"]
        with pytest.raises(UnreadableRecording):
            RecordingReader(tmp_path / "bad.mcap")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[" * 3000 + "]" * 3000, "nested too deep"),
        ("a: &a [1, 2]\nkeep_out: [*a, *a]", "aliases"),
        ("keep_out: [{corners_m: [[0, 0], [1e300, 0], [1, 1]]}]", "corners_m"),
    ],
)
def test_zones_that_are_no_zones(text: str, problem: str) -> None:
    """Refused with a reason, however they are nested, and whatever they repeat."""
    with pytest.raises(ValueError, match=problem):
        parse_zones(text, "zones.yaml")


def test_zones_cost_what_their_edges_cross() -> None:
    """A thousand zigzags across a large map are refused; a circle of a thousand corners on it is not."""
    frame = GridFrame(0.05, Pose2D(0.0, 0.0, 0.0), 4000, 4000)
    zigzag = tuple([(0.2 * number, 200.0 * (number % 2)) for number in range(1000)])
    with pytest.raises(ValueError, match="use fewer corners"):
        require_affordable(Zones(keep_out=(Zone(corners_m=zigzag),)), frame)
    require_affordable(
        Zones(keep_out=(Zone(corners_m=((1, 1), (199, 1), (199, 199), (1, 199))),) * 50), frame
    )


def test_a_cell_is_in_a_zone_by_its_middle() -> None:
    """A triangle with its right angle at the origin, 4 cells long: the middles below the diagonal are in it."""
    frame = GridFrame(1.0, Pose2D(0.0, 0.0, 0.0), 5, 5)
    cells = keep_out_cells(Zones(keep_out=(Zone(corners_m=((0, 0), (4.2, 0), (0, 4.2))),)), frame)
    assert [int(row.sum()) for row in cells] == [4, 3, 2, 1, 0]


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    """What stands in the way of the new one leaves the old one, and nothing beside it."""
    path, obstacle = tmp_path / "page", tmp_path / ".page.new"
    replace_file(path, b"old")
    obstacle.mkdir()
    with pytest.raises(IsADirectoryError):
        replace_file(path, b"new")
    assert path.read_bytes() == b"old"
    obstacle.rmdir()
    replace_file(path, b"new")
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


def test_a_replaced_file_has_its_mode_from_the_first_byte(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where a power cut has left a new one that everybody can read."""
    path, left = tmp_path / "tokens", tmp_path / ".tokens.new"
    left.write_bytes(b"half")
    left.chmod(0o644)
    modes = []
    monkeypatch.setattr(
        storage.os, "fsync", lambda number: modes.append(storage.os.fstat(number).st_mode & 0o777)
    )
    replace_file(path, b"drive 1", 0o600)
    assert modes[0] == path.stat().st_mode & 0o777 == 0o600
    assert path.read_bytes() == b"drive 1"
    assert list(tmp_path.iterdir()) == [path]
