"""NAME.yaml and NAME.pgm: copies of a map's latest version for ROS's tools and editors.

Two files cannot be replaced in one step. So the YAML names the image of the version first, then the image beside it
is replaced, then the YAML names that: whoever reads, even after a power cut, finds two that belong together.
"""

import json
import os
import re
from pathlib import Path

from chefbotd.maps.disk import Disk, replace, sha256
from chefbotd.maps.manifest import DESCRIPTION, IMAGE, NotAManifest
from chefbotd.maps.versions import Version, check, versions

IMAGE_LINE = re.compile(r"^image:.*$", re.MULTILINE)
PLAIN = re.compile(r"[A-Za-z_][\w-]*\.pgm", re.ASCII)


def publish(disk: Disk, folder: Path, name: str, version: Version) -> None:
    """Put the two files of this version beside the map's own folder; what is there as it should be is not touched."""
    image, description = folder / f"{name}.pgm", folder / f"{name}.yaml"
    if (
        _holds(description, beside(version, name))
        and image.is_file()
        and sha256(image) == version.manifest.files[IMAGE].sha256
    ):
        return
    inside = os.path.relpath(version.folder / IMAGE, folder)
    replace(disk, description, naming(version, inside))
    replace(disk, image, (version.folder / IMAGE).read_bytes())
    replace(disk, description, beside(version, name))


def naming(version: Version, image: str) -> bytes:
    """The YAML of a version with another image in it. What is quoted as in JSON is quoted so in YAML."""
    text = (version.folder / DESCRIPTION).read_text(encoding="utf-8")
    quoted = image if PLAIN.fullmatch(image) else json.dumps(image)
    return IMAGE_LINE.sub(lambda _: f"image: {quoted}", text, count=1).encode()


def beside(version: Version, name: str) -> bytes:
    """The YAML that names the image beside it."""
    return naming(version, f"{name}.pgm")


def unpublish(disk: Disk, folder: Path, name: str) -> None:
    """Remove the two files, the YAML first: a map without an image is worse than an image without a map."""
    disk.remove(folder / f"{name}.yaml")
    disk.remove(folder / f"{name}.pgm")
    disk.sync_folder(folder)


def keep_edited(disk: Disk, folder: Path, name: str, version: Version) -> None:
    """Copy the two files, which somebody has changed, beside the version that replaces them."""
    kept = version.folder.parent / f"replaced-by-{version.folder.name}"
    disk.make_folder(kept)
    for suffix in (".yaml", ".pgm"):
        path = folder / f"{name}{suffix}"
        if path.is_file():
            disk.write(kept / path.name, path.read_bytes())
    disk.sync_folder(kept)
    disk.sync_folder(kept.parent)


def edited(folder: Path, own: Path, name: str) -> bool:
    """Whether somebody else has changed the two files, or put them there, since a version was published.

    What a publication that was cut off has left is no change. A file that is missing is none either.
    """
    image, description = folder / f"{name}.pgm", folder / f"{name}.yaml"
    if not description.is_file():
        return False
    readable = _readable(own)
    texts = [
        text
        for version in readable
        for text in (
            beside(version, name),
            naming(version, os.path.relpath(version.folder / IMAGE, folder)),
        )
    ]
    if not any(_holds(description, text) for text in texts):
        return True
    images = {version.manifest.files[IMAGE].sha256 for version in readable}
    return image.is_file() and sha256(image) not in images


def _readable(own: Path) -> list[Version]:
    whole = []
    for number, path in versions(own):
        try:
            whole.append(check(number, path))
        except (OSError, NotAManifest):
            continue
    return whole


def _holds(path: Path, content: bytes) -> bool:
    try:
        return path.stat().st_size == len(content) and path.read_bytes() == content
    except OSError:
        return False
