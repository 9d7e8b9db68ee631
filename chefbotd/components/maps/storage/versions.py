"""The versions of one map: each folder appears whole by one rename, and the newest whole one counts."""

import json
import os
import re
import secrets
import shutil
import stat
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path

from chefbotd.components.maps.storage.disk import TEMPORARY, Content, Disk, MapStoreError, replace, sha256
from chefbotd.components.maps.storage.manifest import (
    DESCRIPTION,
    IMAGE,
    MANIFEST,
    MAX_BYTES,
    Extent,
    FileEntry,
    Manifest,
    NotAManifest,
    parse_manifest,
)
from chefbotd.core.commands import RefusalKind
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence
from chefbotd.storage import open_regular, read_file

LARGEST_FILE_BYTES = 1 << 30
"""Of a map's file: more than the largest image that is imported."""

NAME = re.compile(r"v(\d{6,})")


class Version(Record, frozen=True):
    """A version that is whole: its folder, and what it says of itself."""

    folder: Path
    manifest: Manifest


def versions(folder: Path) -> list[tuple[int, Path]]:
    """Every version's number and folder, the newest first, whole or not."""
    if not folder.is_dir():
        return []
    matches = ((NAME.fullmatch(path.name), path) for path in folder.iterdir())
    return sorted(((int(match[1]), path) for match, path in matches if match), reverse=True)


def check(number: int, folder: Path, *, thorough: bool = False) -> Version:
    """The version in this folder, if it is whole: every file there and as long as it says; ``thorough``: as it was.

    Raises:
        NotAManifest: it is not; the text says why.
        OSError: a file cannot be read.
    """
    with open_regular(folder / MANIFEST) as file:
        manifest = parse_manifest(file.read(MAX_BYTES + 1))
    if manifest.version != number:
        raise NotAManifest(f"the manifest is version {manifest.version}'s")
    for name, entry in manifest.files.items():
        path = folder / name
        status = path.stat()
        size = status.st_size
        if not stat.S_ISREG(status.st_mode):
            raise NotAManifest(f"{name} is no regular file")
        if size != entry.bytes:
            raise NotAManifest(f"{name} has {size} bytes instead of {entry.bytes}")
        if thorough and sha256(path) != entry.sha256:
            raise NotAManifest(f"{name} is damaged: its checksum differs")
    return Version(folder, manifest)


def latest(folder: Path, *, thorough: bool = False) -> tuple[Version | None, dict[int, str]]:
    """The newest version that is whole, and what is wrong with the newer ones, by their numbers."""
    damage: dict[int, str] = {}
    for number, path in versions(folder):
        try:
            return check(number, path, thorough=thorough), damage
        except FileNotFoundError as error:
            damage[number] = f"{Path(str(error.filename)).name} is missing"
        except (OSError, NotAManifest) as error:
            damage[number] = str(error)
    return None, damage


def add(disk: Disk, folder: Path, contents: Mapping[str, Content], extent: Extent, source: str) -> Version:
    """Write a new version beside the others; until its last step nobody sees anything of it.

    Raises:
        OSError: it could not be written; nothing is left of it.
    """
    disk.make_folder(folder)
    number = max((number for number, _ in versions(folder)), default=0) + 1
    temporary = folder / f"{TEMPORARY}{secrets.token_hex(4)}"
    try:
        disk.make_folder(temporary)
        for name, content in contents.items():
            disk.write(temporary / name, content)
        files = {name: entry_of(temporary / name) for name in contents}
        manifest = Manifest(version=number, saved_at_s=time.time(), source=source, extent=extent, files=files)
        disk.write(temporary / MANIFEST, manifest.to_json())
        disk.sync_folder(temporary)
        target = folder / f"v{number:06d}"
        disk.rename(temporary, target)
    except OSError:
        clean(disk, folder)
        raise
    version = Version(target, manifest)
    try:
        disk.sync_folder(folder)
    except OSError:
        take_back(version)
        raise
    return version


def copy_files(disk: Disk, folder: Path, target: Path, names: Iterable[str]) -> None:
    """Copy these regular files of a folder into a new one.

    Raises:
        OSError: one cannot be read or written; what was copied is left.
    """
    disk.make_folder(target)
    for name in names:
        with open_regular(folder / name) as file:
            disk.write(target / name, partial(shutil.copyfileobj, file))
    disk.sync_folder(target)


def take_back(version: Version, published: Path | None = None) -> None:
    """Remove a version that was added just now, and what of it was ``published`` (NAME.yaml); no room is needed."""
    if published is not None:
        image, named = (
            published.with_suffix(".pgm"),
            os.path.relpath(version.folder / IMAGE, published.parent),
        )
        is_its = image.is_file() and sha256(image) == version.manifest.files[IMAGE].sha256
        if is_its or (
            published.is_file() and named in published.read_text(encoding="utf-8", errors="replace")
        ):
            published.unlink(missing_ok=True)
        if is_its:
            image.unlink()
    gone = version.folder.with_name(f"{TEMPORARY}{secrets.token_hex(4)}")
    version.folder.rename(gone)
    shutil.rmtree(gone, ignore_errors=True)


def entry_of(path: Path) -> FileEntry:
    """A file's size and checksum."""
    return FileEntry(bytes=path.stat().st_size, sha256=sha256(path))


def prune(disk: Disk, folder: Path, kept: int) -> None:
    """Remove all but the newest ``kept`` versions that are whole; damaged newer ones stay, to be looked at."""
    whole = 0
    for number, path in versions(folder):
        if whole >= kept:
            discard(disk, path)
            continue
        try:
            check(number, path)
            whole += 1
        except (OSError, NotAManifest):
            continue


def discard(disk: Disk, path: Path) -> None:
    """Remove a folder with all that is in it: out of sight in one step, then its files."""
    gone = path.with_name(f"{TEMPORARY}{secrets.token_hex(4)}")
    disk.rename(path, gone)
    with suppress(OSError):  # nobody sees it any more, and the next change removes the rest
        disk.remove_folder(gone)


def clean(disk: Disk, folder: Path) -> None:
    """Remove what a save or a removal that was cut off has left; what cannot be removed stays."""
    if not folder.is_dir():
        return
    for path in folder.iterdir():
        if path.name.startswith(TEMPORARY):
            with suppress(OSError):
                disk.remove_folder(path) if path.is_dir() else disk.remove(path)


def require(folder: Path, name: str) -> tuple[Version, dict[int, str]]:
    """The newest version that is whole to the last byte.

    Raises:
        MapStoreError: there is none; it says what is wrong with each.
    """
    newest, damage = latest(folder, thorough=True)
    if newest is None:
        damage_text = (
            "; ".join(f"version {number}: {why}" for number, why in damage.items()) or "it has no version"
        )
        raise MapStoreError(
            RefusalKind.MAP_UNREADABLE,
            Sentence(
                "maps.all_damaged",
                "no version of the map {map!r} is whole: {damage}",
                map=name,
                damage=damage_text,
            ),
        )
    return newest, damage


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
    replace(disk, image, read_file(version.folder / IMAGE, LARGEST_FILE_BYTES))
    replace(disk, description, beside(version, name))


def naming(version: Version, image: str) -> bytes:
    """The YAML of a version with another image in it. What is quoted as in JSON is quoted so in YAML."""
    text = read_file(version.folder / DESCRIPTION, LARGEST_FILE_BYTES).decode("utf-8")
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
    """Copy the two files, which were changed by hand, beside the version that replaces them."""
    kept = version.folder.parent / f"replaced-by-{version.folder.name}"
    disk.make_folder(kept)
    for suffix in (".yaml", ".pgm"):
        path = folder / f"{name}{suffix}"
        if path.is_file():
            disk.write(kept / path.name, read_file(path, LARGEST_FILE_BYTES))
    disk.sync_folder(kept)
    disk.sync_folder(kept.parent)


def was_edited(folder: Path, own: Path, name: str) -> bool:
    """Whether the two files were changed or put there by others since a version was published.

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
        return path.stat().st_size == len(content) and read_file(path, len(content)) == content
    except OSError:
        return False
