"""Our own firmware's core as a library: where it comes from, and that each board has one of its own."""

import ctypes
import gc
import shutil
import tomllib
from pathlib import Path

import pytest

from chefbotd.components.simulation import compiled_firmware
from chefbotd.components.simulation.compiled_firmware import (
    LIBRARY,
    CompiledFirmware,
    FakeHal,
    NoCompilerError,
    cache_folder,
    compile_core,
    load_core,
    packaged_firmware,
    read_core,
    source_files,
)
from tests.firmware.host import seal

ROOT = Path(__file__).parents[4]
BYTE_US = 1e6 / 11_520
STANDING = (0.0, 0.0)


def started() -> CompiledFirmware:
    """A board whose program has begun at time 0, and has said its banner."""
    board = CompiledFirmware(BYTE_US)
    board.start(1, 0)
    board.run(19_000, STANDING)
    assert [line for _, line in board.take_lines()][-1] == b"firmware\t1\t0\t1\t4\t15\t1\n"
    return board


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A copy of the firmware's sources."""
    return shutil.copytree(
        packaged_firmware(), tmp_path / "firmware", ignore=shutil.ignore_patterns("build", "boards")
    )


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    """No program is found by its name."""
    monkeypatch.setenv("PATH", "")


def test_two_boards_in_one_process_share_nothing():
    """One has been stopped by e-stop and counts 400 to the left; the other drives on, and its wheels stand."""
    stopped, driving = started(), started()
    for board in (stopped, driving):
        board.receive(b"s 70 -60\r")
    stopped.receive(b"estop\r")
    stopped.run(30_000, (400.0, 0.0))
    driving.run(30_000, STANDING)
    assert [tuple(board.hal.duty) for board in (stopped, driving)] == [(0, 0), (70, -60)]
    lines = [[line for _, line in board.take_lines()] for board in (stopped, driving)]
    assert [sent[1] for sent in lines] == [b"e\t36\t0\n", b"e\t0\t0\n"]  # 400 in 11 ms are 36.4 in the first
    assert [board.hal.micros for board in (stopped, driving)] == [30_000, 30_000]


def test_a_board_that_is_gone_leaves_nothing_loaded():
    """Of 30 boards, one after the other, no descriptor and no memory of the library stays."""

    def loaded() -> int:
        gc.collect()
        return Path("/proc/self/maps").read_text().count("memfd:firmware")

    before = loaded()
    for _ in range(30):
        started()
    assert loaded() == before
    kept = started()
    assert loaded() > before
    del kept


def test_fields_of_the_hardware_are_where_the_library_has_them(tmp_path: Path):
    """The structure in Python is as long as the one in C."""
    (tmp_path / LIBRARY).write_bytes(load_core())
    assert ctypes.CDLL(str(tmp_path / LIBRARY)).host_fake_size() == ctypes.sizeof(FakeHal)


def test_it_is_compiled_once(tmp_path: Path, sources: Path, monkeypatch: pytest.MonkeyPatch):
    """What a compiler has made is taken from the cache then, without a compiler; other sources are compiled anew."""
    compiled = read_core(sources, tmp_path / "cache")
    monkeypatch.setenv("PATH", "")
    assert read_core(sources, tmp_path / "cache") == compiled
    header = sources / "core" / "firmware.h"
    header.write_text(header.read_text().replace("FIRMWARE_MINOR 1", "FIRMWARE_MINOR 2"))
    with pytest.raises(NoCompilerError):
        read_core(sources, tmp_path / "cache")


@pytest.mark.skipif(not (ROOT / "firmware").is_dir(), reason="a wheel has compiled it already")
def test_a_wheel_has_all_that_is_compiled():
    """Each file that a compiler reads is put into the wheel, at the place where it is looked for."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    included = project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    for path in source_files(ROOT / "firmware"):
        name = str(path.relative_to(ROOT))
        source = name if name in included else str(path.parent.relative_to(ROOT))
        assert included[source] == source.replace("firmware/", "chefbotd/firmware_sources/")


def test_what_lies_beside_its_sources_needs_no_compiler(tmp_path: Path, sources: Path, no_compiler: None):
    """A package for one kind of computer brings the library."""
    (sources / LIBRARY).write_bytes(b"a library")
    assert read_core(sources, tmp_path / "cache") == b"a library"


def test_without_library_and_compiler_it_says_what_to_do(tmp_path: Path, sources: Path, no_compiler: None):
    """What is missing, how to install it, and what works without it; and nothing is left in the cache."""
    with pytest.raises(
        NoCompilerError, match=r"no C compiler: install one .*apt-get install gcc.*--sketch tiva"
    ):
        read_core(sources, tmp_path / "cache")
    assert not (tmp_path / "cache").exists()


def test_a_compiler_that_fails_says_why(tmp_path: Path, sources: Path, monkeypatch: pytest.MonkeyPatch):
    """The message has the compiler's own words, and nothing half made is kept."""
    compiler = tmp_path / "bin" / "cc"
    compiler.parent.mkdir()
    compiler.write_text("#!/bin/sh\necho 'stdint.h: No such file or directory' >&2\nexit 1\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("PATH", str(compiler.parent))
    with pytest.raises(OSError, match=r"bin/cc cannot compile our own firmware: stdint.h: No such file"):
        read_core(sources, tmp_path / "cache")
    assert not (tmp_path / "cache").exists()


def test_a_cache_that_cannot_be_written_costs_another_compilation(tmp_path: Path, sources: Path):
    """A file stands where the folder would be: the library is there all the same."""
    (tmp_path / "cache").write_text("")
    assert read_core(sources, tmp_path / "cache")[:4] == b"\x7fELF"
    assert compile_core(sources)[:4] == b"\x7fELF"


def test_a_cache_that_cannot_be_read_costs_another_compilation(tmp_path: Path, sources: Path):
    """It lies in the home of somebody else: the library is compiled all the same."""
    compiled = read_core(sources, tmp_path / "cache")
    (kept,) = (tmp_path / "cache").iterdir()
    kept.unlink()
    kept.mkdir()  # the superuser can read any file, but no folder
    assert read_core(sources, tmp_path / "cache") == compiled


@pytest.mark.parametrize(
    ("environment", "folder"),
    [
        (
            {"CACHE_DIRECTORY": "/var/cache/chefbotd:/var/cache/more", "XDG_CACHE_HOME": "/x"},
            "/var/cache/chefbotd",
        ),
        ({"XDG_CACHE_HOME": "/x"}, "/x/chefbotd"),
        ({"XDG_CACHE_HOME": "x"}, "~/.cache/chefbotd"),
        ({}, "~/.cache/chefbotd"),
    ],
)
def test_the_cache_is_the_services_or_the_users(environment: dict[str, str], folder: str):
    """A service has its own folder; a user's is where XDG says, which has to be an absolute path."""
    assert cache_folder(environment) == Path(folder).expanduser()


def test_a_library_that_cannot_be_loaded_leaves_no_file_open(monkeypatch: pytest.MonkeyPatch):
    """It is of another kind of computer, or damaged."""
    monkeypatch.setattr(compiled_firmware, "load_core", lambda: b"no library")
    before = set(Path("/proc/self/fd").iterdir())
    with pytest.raises(OSError, match="file too short"):
        CompiledFirmware(BYTE_US)
    gc.collect()
    assert set(Path("/proc/self/fd").iterdir()) <= before


def test_a_wheel_that_turns_evenly_is_the_same_in_one_call_and_in_many():
    """Half a count a millisecond under the board's own wheel loop: the same duty and lines, however time is cut."""
    runs = []
    for steps in ([28_000], [21_500, 23_000, 25_999, 28_000]):
        board, gains = started(), (1000, 600, 4000, 900, 1500)
        bodies = [
            "hello 1 2000",
            *[f"g {number} {value}" for number, value in enumerate(gains)],
            "w 3000 -2000",
        ]
        for number, body in enumerate(bodies):
            board.receive(f"{seal(f'{body} {number}')}\r".encode())
        board.run(20_000, STANDING)
        for at_us in steps:
            board.run(at_us, ((at_us - 20_000) / 2000, (20_000 - at_us) / 3000))
        runs.append((tuple(board.hal.duty), list(board.take_lines())))
    assert runs[0] == runs[1]
    assert 0 not in runs[0][0]
