"""The folder of maps: for each map a folder with its versions, and two published files.

    flat.yaml flat.pgm              the latest version, for ROS's tools and for editors
    flat.map/v000007/               a version: map.yaml, map.pgm, cells.zlib, manifest.json; slam.npz to go on with
    flat.map/places.json            its named places
    .autosave.map/                  what is being mapped, now and then

Whatever is interrupted at whatever moment, also by `kill -9` or a power cut, leaves the old state or the new one.
What the disk refuses has not been done: whoever is told so finds all as it was.
Several processes may use a folder: one at a time changes it. Nothing here is for the event loop: it waits for the disk.
"""

import hashlib
import json
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from chefbotd.components.maps.storage import disk as disks
from chefbotd.components.maps.storage.disk import TEMPORARY, Content, Disk, MapStoreError, refusing_os_errors
from chefbotd.components.maps.storage.killers import KILLED
from chefbotd.components.maps.storage.manifest import MANIFEST, MAX_BYTES, Extent, Manifest
from chefbotd.components.maps.storage.names import map_name
from chefbotd.components.maps.storage.versions import (
    Version,
    add,
    clean,
    copy_files,
    discard,
    keep_edited,
    latest,
    prune,
    publish,
    require,
    take_back,
    unpublish,
    versions,
    was_edited,
)
from chefbotd.core.commands import RefusalKind
from chefbotd.core.record import Record
from chefbotd.core.sentence import Sentence
from chefbotd.storage import read_file

SUFFIX = ".map"
AUTOSAVE = ".autosave"
CURRENT, RENAMING, UNFINISHED = ".current.json", "renaming.json", "unfinished"


class StoredMap(Record, frozen=True):
    """What is known of a map without reading its cells; ``damage`` says what is wrong, by version.

    ``manifest`` is the newest whole version's; None: there is none, or these are files of others (``plain``).
    """

    name: str
    manifest: Manifest | None
    versions: tuple[int, ...] = ()
    damage: Mapping[int, str] | None = None
    plain: bool = False


LARGEST_BESIDE_BYTES = 1 << 20
"""Of places or zones: three times as much as the most places take."""


def revision_of(content: bytes | None) -> str:
    """What tells one content of a file from another, edited by hand or not; ``none`` where there is no file."""
    return "none" if content is None else hashlib.sha256(content).hexdigest()[:16]


class MapStore:
    """The maps in ``folder``, of which ``versions_kept`` each. Every method raises ``MapStoreError``."""

    def __init__(self, folder: Path, versions_kept: int = 3, disk: Disk | None = None) -> None:
        self.folder, self._kept = folder, versions_kept
        self._disk = disk or Disk()

    # reading

    def names(self) -> list[str]:
        """Every map, in alphabetical order, those of which no version is whole and those of others too."""
        with refusing_os_errors("list the maps", self.folder):
            if not self.folder.is_dir():
                return []
            own = {path.name[: -len(SUFFIX)] for path in self.folder.glob(f"*{SUFFIX}") if versions(path)}
            plain = {path.name.removesuffix(".yaml") for path in self.folder.glob("*.yaml")}
        return sorted(name for name in own | plain if _is_name(name))

    def describe(self, name: str, *, thorough: bool = False) -> StoredMap:
        """What is known of a map; ``thorough`` reads every byte, so that damage which changes no size is found too."""
        own = self._own(name)
        with refusing_os_errors(f"inspect the map {name!r}", own):
            if numbers := tuple(number for number, _ in versions(own)):
                newest, damage = latest(own, thorough=thorough)
                return StoredMap(name, None if newest is None else newest.manifest, numbers, damage)
            if (self.folder / f"{name}.yaml").is_file():
                return StoredMap(name, None, plain=True)
        raise self._unknown(name)

    def read(self, name: str) -> tuple[Version, dict[int, str]]:
        """The newest version of a map that is whole, and what is wrong with newer ones."""
        own = self._own(name)
        with refusing_os_errors(f"read the map {name!r}", own):
            if not versions(own):
                raise self._unknown(name)
            return require(own, name)

    def read_file(self, name: str, file: str) -> tuple[Manifest, bytes]:
        """A file of the newest version of a map that is whole; one that is pruned meanwhile gives way to a newer one."""
        while True:
            version, _ = self.read(name)
            if file not in version.manifest.files:
                raise MapStoreError(
                    RefusalKind.MAP_UNREADABLE,
                    Sentence("maps.lacks_file", "the map {map!r} has no {file}", map=name, file=file),
                )
            with refusing_os_errors(f"read the map {name!r}", version.folder):
                try:
                    return version.manifest, read_file(
                        version.folder / file, version.manifest.files[file].bytes
                    )
                except FileNotFoundError:
                    if version.folder.exists():
                        raise

    def needs_import(self, name: str) -> bool:
        """Whether NAME.yaml and NAME.pgm are files of others: put there, or changed after they were saved."""
        with refusing_os_errors(f"inspect the map {name!r}", self.folder):
            return was_edited(self.folder, self._own(name), map_name(name))

    # writing

    def save(self, name: str, contents: Mapping[str, Content], extent: Extent, source: str) -> Version:
        """Write a version (by the names of ``manifest``), make it the latest, and remove the oldest ones."""
        own = self._own(name)
        with self._changing(f"save the map {name!r}"):
            self._begin(own)
            version = add(self._disk, own, contents, extent, source)
            try:
                self._publish_files(map_name(name))
            except OSError:
                take_back(version, self.folder / f"{map_name(name)}.yaml")
                raise
            with suppress(OSError):  # the next save removes them
                prune(self._disk, own, self._kept)
        return version

    def autosave(self, contents: Mapping[str, Content], extent: Extent, source: str) -> Version:
        """Write what is being mapped; the version before it is kept."""
        with self._changing("save the unfinished map"):
            version = add(self._disk, self._autosaved, contents, extent, source)
            prune(self._disk, self._autosaved, 2)
        return version

    def read_autosave(self) -> Version | None:
        """The latest autosave that is whole, if there is one."""
        return self.look_at_autosave()[0]

    def look_at_autosave(self) -> tuple[Version | None, dict[int, str]]:
        """The latest autosave that is whole, if there is one, and what is wrong with newer ones, by their numbers."""
        with refusing_os_errors("read the unfinished map", self._autosaved):
            return latest(self._autosaved, thorough=True)

    def discard_autosave(self) -> None:
        """Forget what was being mapped: it has been saved, or nobody wants it."""
        with self._changing("remove the unfinished map"):
            if self._autosaved.is_dir():
                discard(self._disk, self._autosaved)

    def rename(self, name: str, new: str) -> None:
        """Give a map another name."""
        old, new = map_name(name), map_name(new)
        with self._changing(f"rename the map {old!r}"):
            self._require_own(old)
            if new in self.names():
                raise MapStoreError(
                    RefusalKind.MAP_EXISTS, Sentence("maps.exists", "there is a map {map!r} already", map=new)
                )
            note = self._own(old) / RENAMING
            disks.replace(self._disk, note, json.dumps({"from": old, "to": new}).encode())
            unpublish(self._disk, self.folder, old)
            self._disk.rename(self._own(old), self._own(new))
            try:
                self._disk.sync_folder(self.folder)
                self._finish_renaming(old, new)
            except OSError:  # the note has the next change publish its files again
                for suffix in (".yaml", ".pgm"):
                    (self.folder / f"{new}{suffix}").unlink(missing_ok=True)
                self._own(new).rename(self._own(old))
                raise

    def copy(self, name: str, new: str) -> Version:
        """Store a map's newest whole version once more, by another name, with all that lies beside it."""
        old, new = map_name(name), map_name(new)
        with self._changing(f"copy the map {old!r}"):
            self._require_own(old)
            if new in self.names():
                raise MapStoreError(
                    RefusalKind.MAP_EXISTS, Sentence("maps.exists", "there is a map {map!r} already", map=new)
                )
            version, _ = require(self._own(old), old)
            temporary = self.folder / f"{TEMPORARY}{secrets.token_hex(4)}"
            try:
                files = (*version.manifest.files, MANIFEST)
                copy_files(self._disk, version.folder, temporary / version.folder.name, files)
                beside = [path.name for path in self._own(old).iterdir() if _is_beside(path)]
                copy_files(self._disk, self._own(old), temporary, beside)
                self._begin(temporary)
                self._disk.rename(temporary, self._own(new))
            except OSError:
                clean(self._disk, self.folder)
                raise
            try:
                self._disk.sync_folder(self.folder)
                self._publish_files(new)
            except OSError:
                for suffix in (".yaml", ".pgm"):
                    (self.folder / f"{new}{suffix}").unlink(missing_ok=True)
                self._own(new).rename(temporary)
                shutil.rmtree(temporary, ignore_errors=True)
                raise
        return Version(self._own(new) / version.folder.name, version.manifest)

    def delete(self, name: str) -> None:
        """Remove a map with all its versions and its places."""
        name = map_name(name)
        with self._changing(f"delete the map {name!r}"):
            if name not in self.names():
                raise self._unknown(name)
            if self._own(name).is_dir():
                self._begin(self._own(name))
            unpublish(self._disk, self.folder, name)
            with self._not_in_use(name):
                if self._own(name).is_dir():
                    gone = self.folder / f"{TEMPORARY}{secrets.token_hex(4)}"
                    self._disk.rename(self._own(name), gone)
                    try:
                        self._disk.sync_folder(self.folder)
                    except OSError:
                        gone.rename(self._own(name))
                        raise
                    with suppress(OSError):  # the next change removes the rest
                        self._disk.remove_folder(gone)

    @contextmanager
    def _not_in_use(self, name: str) -> Iterator[None]:
        """Forget that a map is in use; it is in use as before where this block fails."""
        if self.current() != name:
            yield
            return
        aside = self.folder / f"{TEMPORARY}{CURRENT}"
        self._disk.rename(self.folder / CURRENT, aside)
        try:
            yield
        except OSError:
            aside.rename(self.folder / CURRENT)
            raise
        with suppress(OSError):  # the next change removes it
            self._disk.remove(aside)

    def repair(self) -> None:
        """Finish or remove what a process that was killed has left; done before each change too."""
        with self._changing("inspect the maps"):
            pass

    def change_beside(self, name: str, file: str, change: Callable[[bytes | None], bytes]) -> None:
        """Replace a file that belongs to all versions of a map, such as its places, by what ``change`` makes of it.

        Nobody else changes it meanwhile.
        """
        with self._changing(f"write the {Path(file).stem} of the map {name!r}"):
            self._require_own(map_name(name))
            content = change(self._content_beside(name, file))
            disks.replace(self._disk, self._own(name) / file, content)

    def read_beside(self, name: str, file: str) -> bytes | None:
        """A file that belongs to all versions of a map; None where there is none."""
        with refusing_os_errors(f"read the {Path(file).stem} of the map {name!r}", self._own(name)):
            if map_name(name) not in self.names():
                raise self._unknown(name)
            return self._content_beside(name, file)

    def _content_beside(self, name: str, file: str) -> bytes | None:
        try:
            return read_file(self._own(name) / file, LARGEST_BESIDE_BYTES)
        except FileNotFoundError:
            return None

    # the map in use

    def current(self) -> str | None:
        """The map that was in use last, for the next start of the daemon; None too where that is unknown."""
        try:
            name = json.loads(read_file(self.folder / CURRENT, MAX_BYTES))["name"]
            return map_name(name) if isinstance(name, str) else None
        except (OSError, ValueError, KeyError, TypeError, RecursionError, MapStoreError):
            return None

    def set_current(self, name: str) -> None:
        """Remember the map in use."""
        with self._changing("remember which map is in use"):
            self._require_own(map_name(name))
            disks.replace(self._disk, self.folder / CURRENT, json.dumps({"name": map_name(name)}).encode())

    # inside

    @property
    def _autosaved(self) -> Path:
        return self.folder / f"{AUTOSAVE}{SUFFIX}"

    def _own(self, name: str) -> Path:
        return self.folder / f"{map_name(name)}{SUFFIX}"

    def _unknown(self, name: str) -> MapStoreError:
        names = self.names()
        existing = f"there are {', '.join(names)}" if names else "there are none"
        return MapStoreError(
            RefusalKind.UNKNOWN_MAP,
            Sentence("maps.unknown", "no map named {map!r}; {others}", map=name, others=existing),
        )

    def _require_own(self, name: str) -> None:
        if versions(self._own(name)):
            return
        if name in self.names():
            raise MapStoreError(
                RefusalKind.MAP_UNREADABLE,
                Sentence(
                    "maps.foreign_file", "the map {map!r} was not saved by chefbotd: load it first", map=name
                ),
            )
        raise self._unknown(name)

    @contextmanager
    def _changing(self, doing: str) -> Iterator[None]:
        """Alone, and after what a process that was killed has left is finished or removed."""
        with refusing_os_errors(doing, self.folder):
            self._disk.make_folder(self.folder)
            with disks.lock_folder(self.folder):
                self._repair()
                yield

    def _begin(self, own: Path) -> None:
        """Leave word that the two files for everybody may be missing or old, until they have been published."""
        self._disk.make_folder(own)
        self._disk.write(own / UNFINISHED, b"")
        self._disk.sync_folder(own)

    def _publish_files(self, name: str) -> None:
        """Put the two files there; what others have changed in them is kept first."""
        own = self._own(name)
        version, _ = latest(own)
        if version is not None:
            if was_edited(self.folder, own, name):
                keep_edited(self._disk, self.folder, name, version)
            publish(self._disk, self.folder, name, version)
        with suppress(OSError):  # then the next change publishes them again
            self._disk.remove(own / UNFINISHED)

    def _repair(self) -> None:
        for folder in (self.folder, self._autosaved):
            clean(self._disk, folder)
        for own in self.folder.glob(f"*{SUFFIX}"):
            name = own.name[: -len(SUFFIX)]
            if not _is_name(name):
                continue
            clean(self._disk, own)
            if (own / RENAMING).is_file():
                self._repair_renaming(own, name)
            if not versions(own) and {path.name for path in own.iterdir()} <= {UNFINISHED}:
                discard(self._disk, own)  # a first save that was cut off
            elif (own / UNFINISHED).is_file():
                self._publish_files(name)

    def _repair_renaming(self, own: Path, name: str) -> None:
        try:
            note = json.loads(read_file(own / RENAMING, MAX_BYTES))
            old, new = map_name(note["from"]), map_name(note["to"])
        except (ValueError, KeyError, TypeError, RecursionError, MapStoreError):
            old = new = name
        if name == new != old:
            self._finish_renaming(old, new)
        else:
            self._publish_files(name)
            self._disk.remove(own / RENAMING)

    def _finish_renaming(self, old: str, new: str) -> None:
        """The folder has its new name: so have the files beside it, and the map in use."""
        self._publish_files(new)
        if self.current() == old:
            disks.replace(self._disk, self.folder / CURRENT, json.dumps({"name": new}).encode())
        with suppress(OSError):  # then the next change finishes it again
            self._disk.remove(self._own(new) / RENAMING)


def _is_beside(path: Path) -> bool:
    """Whether this in a map's folder belongs to the map whatever it is called: its places, zones and edits."""
    is_own = path.name in (RENAMING, UNFINISHED, KILLED) or path.name.startswith(TEMPORARY)
    return path.is_file() and not is_own


def _is_name(stem: str) -> bool:
    try:
        return map_name(stem) == stem
    except MapStoreError:
        return False
