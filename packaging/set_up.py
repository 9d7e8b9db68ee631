"""Makes an environment with what is locked, and says what it does: python packaging/set_up.py FOLDER [OPTION ...].

    --lock FILE       install exactly these packages, checked by their hashes (default: requirements.lock)
    --newest EXTRAS   install the newest releases that pyproject.toml allows instead
    --wheel FILE      install chefbotd from a wheel; without it, this folder as it is (editable)

The standard library is all that it needs.
"""

import argparse
import re
import subprocess
import sys
import time
import venv
from collections.abc import Sequence
from pathlib import Path

INTERRUPTED = 130
"""As of a program that was ended by Ctrl-C."""

EVERY = 10
"""Where nobody watches a terminal, one package in ten is named."""


def main(arguments: Sequence[str]) -> int:
    """Carry out the command line; the exit code is pip's."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--lock", type=Path, default=Path("requirements.lock"))
    parser.add_argument("--newest", default="")
    parser.add_argument("--wheel", default="")
    asked = parser.parse_args(arguments)
    began_s = time.monotonic()
    try:
        code = _set_up(asked)
    except KeyboardInterrupt:
        code = INTERRUPTED
    said = {0: "Done", INTERRUPTED: "Interrupted: run it again to go on; it ended"}.get(code, "Failed")
    print(f"{said} after {time.monotonic() - began_s:.0f} s", flush=True)
    return code


def _set_up(asked: argparse.Namespace) -> int:
    """Make the environment, and install what is asked for; the exit code is pip's."""
    print(f"[1/3] Making the environment {asked.folder} with Python {sys.version.split()[0]}", flush=True)
    venv.create(asked.folder, with_pip=True, symlinks=True)
    pip = [str(asked.folder / "bin/python"), "-m", "pip", "install", "--progress-bar", "off"]
    project = [asked.wheel] if asked.wheel else ["--no-build-isolation", "--editable", "."]
    if asked.newest:
        print("[2/3] Downloading and installing the newest releases, some 100 MB", flush=True)
        code = _install([*pip, "--upgrade", "hatchling", "editables", "--editable", f".[{asked.newest}]"], 0)
    else:
        count = sum(re.match(r"\S+==", line) is not None for line in asked.lock.open())
        print(f"[2/3] Downloading and installing up to {count} packages, some 100 MB", flush=True)
        code = _install([*pip, "--no-deps", "--require-hashes", "--requirement", str(asked.lock)], count)
    if code == 0:
        print("[3/3] Installing chefbotd", flush=True)
        code = _install([*pip, "--no-deps", *project], 0)
    return code


def _install(command: Sequence[str], count: int) -> int:
    """Run pip, and show which package it is at; what goes wrong it says itself."""
    number, watched = 0, sys.stdout.isatty()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as pip:
        assert pip.stdout is not None
        for line in pip.stdout:
            if line.startswith("Installing collected"):
                print("\r\033[K" * watched + "      unpacking", flush=True)
            if (collecting := re.match(r"Collecting ([^\s;]+)", line)) is None:
                continue
            number += 1
            said = f"      {number}{f' of {count}' * bool(count)}: {collecting[1]}"
            if watched:
                print(f"\r\033[K{said}", end="", flush=True)
            elif number % EVERY == 1:
                print(said, flush=True)
    return pip.returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
