"""Puts built images into the folder of images with a list of them, or checks that they are there.

Usage: python3 list_images.py write|check BUILT_IMAGE...
"""

import hashlib
import json
import re
import shutil
import sys
from pathlib import Path

FOLDER = Path(__file__).parent / "images"
LIST = FOLDER / "images.json"
VERSION = re.compile(r"#define FIRMWARE_(MAJOR|MINOR) ([0-9]+)")


def version() -> str:
    """The firmware's version, as its header has it."""
    numbers = dict(VERSION.findall((FOLDER.parent / "core" / "firmware.h").read_text(encoding="ascii")))
    return f"{numbers['MAJOR']}.{numbers['MINOR']}"


def listed(images: list[Path]) -> dict[str, object]:
    """What ``images.json`` says of these images; a board is named by its image's file."""
    boards = {
        image.stem: {"file": image.name, "sha256": hashlib.sha256(image.read_bytes()).hexdigest()}
        for image in images
    }
    return {"version": version(), "boards": boards}


def main(action: str, *names: str) -> str:
    """Carry out the action; what is wrong, or nothing."""
    images = [Path(name) for name in names]
    if action == "write":
        FOLDER.mkdir(exist_ok=True)
        for image in images:
            shutil.copyfile(image, FOLDER / image.name)
        LIST.write_text(json.dumps(listed(images), indent=2) + "\n", encoding="ascii")
    elif json.loads(LIST.read_text(encoding="ascii")) != listed(images):
        return f"{LIST} is not what these sources make: run 'make -C firmware images' and commit it"
    else:
        for image in images:
            if image.read_bytes() != (FOLDER / image.name).read_bytes():
                return f"{FOLDER / image.name} is not what these sources make"
    return ""


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]) or 0)
