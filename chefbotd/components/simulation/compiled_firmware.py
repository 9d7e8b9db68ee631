"""Our own firmware's core, compiled for this computer: the sources of ``firmware/core``, on hardware that is variables.

The library is compiled once, when it is first needed, and kept in the user's cache. ctypes, not cffi: it comes with
Python. The core keeps its state in C's variables, so each board loads a copy of its own.
"""

import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from ctypes import (
    POINTER,
    c_bool,
    c_char_p,
    c_double,
    c_int16,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
    c_void_p,
)
from functools import cache
from pathlib import Path

from chefbotd.packaged import find_packaged
from chefbotd.storage import replace_file

COMPILERS = ("cc", "gcc", "clang")
FLAGS = ("-std=c11", "-O2", "-shared", "-fPIC", "-DHAL_CAPABILITIES=15", "-Ihost", "-Icore")
"""The capabilities are those of the real boards' images: wheel loop, ultrasonic sensor, IMU, battery."""

LIBRARY = "libfirmware_host.so"
MOST_LINE_BYTES = 255
"""What the transmit ring holds."""


class NoCompilerError(OSError):
    """There is neither a compiled core nor a compiler; the message says what to do."""


def cache_folder(environment: Mapping[str, str]) -> Path:
    """``CacheDirectory=`` of the unit (systemd.exec(5)), else XDG's folder for caches."""
    if given := environment.get("CACHE_DIRECTORY"):
        return Path(given.split(":")[0])
    own = environment.get("XDG_CACHE_HOME", "")
    return (Path(own) if own.startswith("/") else Path.home() / ".cache") / "chefbotd"


@cache
def load_core() -> bytes:
    """The core of the firmware that comes with chefbotd; raises what ``read_core`` does."""
    return read_core(packaged_firmware(), cache_folder(os.environ))


def packaged_firmware() -> Path:
    """The folder of the firmware's sources: in the installed package, or in the source tree."""
    return find_packaged("firmware_sources", "firmware")


def read_core(sources: Path, cached: Path) -> bytes:
    """The library: compiled already beside its sources or in the folder of caches, or by a compiler now, once.

    Raises:
        NoCompilerError: it has to be compiled, and there is no compiler.
        OSError: the compiler has failed, and what it said.
    """
    kept = cached / f"firmware-{_fingerprint(sources)}.so"
    for path in (sources / LIBRARY, kept):
        with suppress(OSError):
            return path.read_bytes()
    core = compile_core(sources)
    with suppress(OSError):  # where the cache cannot be read or written, the next program compiles again
        kept.parent.mkdir(parents=True, exist_ok=True)
        replace_file(kept, core)
    return core


def compile_core(sources: Path) -> bytes:
    """What a compiler makes of the sources; raises what ``read_core`` does."""
    compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
    if compiler is None:
        raise NoCompilerError(
            "the simulated board cannot run our own firmware, which has to be compiled, and there is no C compiler: "
            "install one (Debian: apt-get install gcc), or let it run a published sketch (--sketch tiva)"
        )
    names = [str(path.relative_to(sources)) for path in source_files(sources) if path.suffix == ".c"]
    with tempfile.TemporaryDirectory(prefix="chefbotd-") as scratch:
        library = Path(scratch) / LIBRARY
        command = [compiler, *FLAGS, "-o", str(library), *names]
        done = subprocess.run(command, cwd=sources, capture_output=True, text=True, check=False)  # noqa: S603 - fixed words
        if done.returncode != 0:
            raise OSError(f"{compiler} cannot compile our own firmware: {done.stderr.strip()}")
        return library.read_bytes()


def source_files(sources: Path) -> list[Path]:
    """What the library is made of, in the order in which it is compiled."""
    host = [sources / "host" / name for name in ("board.h", "fake_hal.h", "simulated.h")]
    host += [sources / "host" / name for name in ("fake_hal.c", "drive.c", "simulated.c")]
    return [*sorted((sources / "core").glob("*.[ch]")), *host]


def _fingerprint(sources: Path) -> str:
    """Another one for other sources, flags or computers."""
    digest = hashlib.sha256(" ".join([*FLAGS, platform.machine()]).encode())
    for path in source_files(sources):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


class FakeHal(ctypes.Structure):
    """``struct fake_hal`` of firmware/host/fake_hal.h, field by field."""

    _fields_ = (
        *[
            (name, c_uint32)
            for name in ("micros", "run_us", "locks", "tick_at_lock", "tick_micros", "lock_errors")
        ],
        *[(name, c_uint32) for name in ("motor_writes", "pings", "feeds", "restarts", "imu_us")],
        ("duty", c_int16 * 2),
        ("imu", c_int16 * 6),
        ("battery", c_uint16),
        ("current", c_uint16 * 2),
        ("levels", c_uint8 * 2),
        ("depth", c_uint8),
        *[
            (name, c_bool)
            for name in ("is_sending", "has_imu", "has_watchdog", "is_new_imu", "is_new_battery")
        ],
        ("is_new_current", c_bool * 2),
        ("shut", c_uint8),
        ("opened", c_uint8),
    )


_LineBytes = c_uint8 * MOST_LINE_BYTES
_FUNCTIONS = {
    "open": ((c_double,), None),
    "start": ((c_uint8, c_uint32), None),
    "run": ((c_uint64, c_double, c_double), c_uint64),
    "receive": ((c_char_p, c_uint32), None),
    "echo": ((c_uint64, c_uint64), None),
    "next_us": ((), c_uint64),
    "duty_since_us": ((), c_uint64),
    "take": ((_LineBytes, POINTER(c_uint64)), c_uint32),
}
_CLOSE = ctypes.CDLL(None).dlclose
_CLOSE.argtypes = (c_void_p,)


class CompiledFirmware:
    """The core on a board of its own (``firmware/host/simulated.h``), powered on at time 0. Times are in microseconds.

    ``hal`` is the board's hardware. A byte takes ``byte_us`` on the line.

    Raises:
        NoCompilerError, OSError: as ``load_core``.
    """

    def __init__(self, byte_us: float) -> None:
        core = load_core()
        self._descriptor = os.memfd_create("firmware")  # a library has one name as long as it is loaded
        Path(f"/proc/self/fd/{self._descriptor}").write_bytes(core)
        self._library = ctypes.CDLL(f"/proc/self/fd/{self._descriptor}")
        for name, (arguments, result) in _FUNCTIONS.items():
            function = getattr(self._library, f"simulated_{name}")
            function.argtypes, function.restype = arguments, result
        self.hal = FakeHal.in_dll(self._library, "fake")
        self._line, self._left_us = _LineBytes(), c_uint64()
        self._library.simulated_open(byte_us)

    def __del__(self) -> None:
        if (library := getattr(self, "_library", None)) is not None:
            _CLOSE(library._handle)
        if (descriptor := getattr(self, "_descriptor", None)) is not None:
            os.close(descriptor)

    def start(self, cause: int, micros: int) -> None:
        """Begin the program now, at this reading of its clock."""
        self._library.simulated_start(cause, micros)

    def run(self, to_us: int, counts: Sequence[float]) -> int:
        """Let time go on, and the wheels turn evenly to these counts; the time that it is.

        It is earlier where the ultrasonic sensor was asked, or the program wants to restart.
        """
        return int(self._library.simulated_run(to_us, *counts))

    def receive(self, data: bytes) -> None:
        """Bytes that come in now."""
        self._library.simulated_receive(data, len(data))

    def echo(self, rises_us: int, falls_us: int) -> None:
        """When the line of the ultrasonic sensor rises and falls."""
        self._library.simulated_echo(rises_us, falls_us)

    @property
    def next_us(self) -> int:
        """No line is sent, and none has left, before then."""
        return int(self._library.simulated_next_us())

    @property
    def duty_since_us(self) -> int:
        """Since when the duty is on the motors that is."""
        return int(self._library.simulated_duty_since_us())

    def take_lines(self) -> Iterator[tuple[int, bytes]]:
        """What has left by now, line by line, each with the time of its last byte."""
        while length := self._library.simulated_take(self._line, self._left_us):
            yield self._left_us.value, bytes(self._line[:length])


if __name__ == "__main__":  # for a package that is built for one kind of computer
    (packaged_firmware() / LIBRARY).write_bytes(compile_core(packaged_firmware()))
