"""What the tests of the firmware need installed: where it is missing they skip, or fail if they are required."""

import fcntl
import os
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FIRMWARE = ROOT / "firmware"
BUILD = FIRMWARE / "build"

PACKAGES = {
    "gcc": "gcc",
    "make": "make",
    "clang": "clang libclang-rt-14-dev",
    "cppcheck": "cppcheck",
    "avr-gcc": "gcc-avr avr-libc",
    "arm-none-eabi-gcc": "gcc-arm-none-eabi libnewlib-arm-none-eabi",
    "qemu-system-arm": "qemu-system-arm",
}
"""The Debian package of each program."""


def need(*programs: str) -> None:
    """Skip the test, naming the packages, if a program is missing; fail it where FIRMWARE_TESTS=required."""
    missing = [PACKAGES[program] for program in programs if shutil.which(program) is None]
    if missing:
        refuse(f"apt-get install {' '.join(missing)}")
    if not FIRMWARE.is_dir():
        refuse("the firmware's sources are not beside the tests")


def need_header(header: str, packages: str) -> None:
    """The same for a library of which this header is missing."""
    if not (Path("/usr/include") / header).is_file():
        refuse(f"apt-get install {packages}")


def refuse(reason: str) -> None:
    """Skip the test for this reason, or fail it where FIRMWARE_TESTS=required."""
    if os.environ.get("FIRMWARE_TESTS") == "required":
        pytest.fail(f"the firmware's tests are required: {reason}")
    pytest.skip(f"the firmware's tests need what is missing: {reason}")


@cache
def make(target: str) -> None:
    """Build a target of firmware/Makefile, one process at a time; raises AssertionError with what make says."""
    BUILD.mkdir(exist_ok=True)
    with (BUILD / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = subprocess.run(["make", "-C", FIRMWARE, target], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
