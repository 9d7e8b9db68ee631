"""Prints what pip's report would install as requirements.lock has it, with the hashes: locked REPORT LOCK.

The standard library is all that it needs.
"""

import json
import re
import sys
from pathlib import Path

OURS = "chefbotd"


def normalized(name: str) -> str:
    """The name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def main(report: Path, lock: Path) -> None:
    """One entry of the lock for each package; ends the program if one is not locked to the version in the report."""
    locked = {}
    for entry in re.split(r"\n(?=\S)", lock.read_text(encoding="utf-8")):
        if head := re.match(r"([A-Za-z0-9._-]+)==([^\s;]+)", entry):
            locked[normalized(head[1]), head[2]] = entry
    for package in json.loads(report.read_text(encoding="utf-8"))["install"]:
        name, version = normalized(package["metadata"]["name"]), package["metadata"]["version"]
        if name == OURS:
            continue
        if (name, version) not in locked:
            sys.exit(f"{name} {version} is not in {lock}")
        print(locked[name, version])


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
