"""Tells a test that fails from one that fails now and then, and runs all of them on a busy computer.

    python tests/flaky.py again NOTES COMMAND...     run what failed last once more; who passes then is noted by name
    python tests/flaky.py report NOTES               name those at the end; exit code 1, but for the ``KNOWN`` ones
    python tests/flaky.py loaded RUNS COMMAND...     run the tests so often, with busy loops beside, and name who failed

COMMAND runs pytest in this folder. The standard library is all that this needs: an installed wheel's tests use it, too.
"""

import json
import subprocess
import sys
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

KNOWN: Mapping[str, str] = {}
"""Tests that may fail once, each with its reason. Without a reason that the test cannot be rid of, there is none."""

LAST_FAILED = Path(".pytest_cache/v/cache/lastfailed")
BUSY_LOOPS = 6


def failed() -> set[str]:
    """The tests that failed in the last run, as pytest remembers them."""
    return set(json.loads(LAST_FAILED.read_text())) if LAST_FAILED.exists() else set()


def again(notes: Path, command: Collection[str]) -> int:
    """Run what failed once more; 0 where all of it passes now. Where no test has failed, something else did: 1."""
    before = failed()
    if not before:
        return 1
    code = subprocess.run([*command, "--last-failed", "--last-failed-no-failures", "none"]).returncode
    notes.parent.mkdir(parents=True, exist_ok=True)
    with notes.open("a") as file:
        file.writelines(f"{name}\n" for name in sorted(before - failed()))
    return code


def report(notes: Path, known: Mapping[str, str] = KNOWN) -> int:
    """Name those that failed and then passed; 1 where one of them is not known."""
    names = sorted(set(notes.read_text().splitlines())) if notes.exists() else []
    for name in names:
        print(f"failed and then passed: {name} ({known.get(name, 'not known: mend it')})")  # noqa: T201
    return int(any(name not in known for name in names))


def loaded(runs: int, command: Collection[str]) -> int:
    """Run the tests on a busy computer; 0 where no test has failed in any run."""
    seen: list[set[str]] = []
    with _busy_loops(BUSY_LOOPS):
        for _ in range(runs):
            LAST_FAILED.unlink(missing_ok=True)
            code = subprocess.run(command).returncode
            seen.append(failed() or ({f"exit code {code}"} if code else set()))
    for number, names in enumerate(seen, 1):
        print(f"run {number} of {runs}: {len(names)} failed", *sorted(names), sep="\n  ")  # noqa: T201
    return int(any(seen))


@contextmanager
def _busy_loops(count: int) -> Iterator[None]:
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def main(what: str, argument: str, *command: str) -> int:
    """Carry out the command line."""
    if what == "again":
        return again(Path(argument), command)
    return report(Path(argument)) if what == "report" else loaded(int(argument), command)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
