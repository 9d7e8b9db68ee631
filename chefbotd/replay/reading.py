"""Reads the messages of a recording's files in their order of writing, up to the end of each file."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from chefbotd import __version__
from chefbotd.recording.encoder import REPEATED
from chefbotd.recording.reader import OWN, RecordingReader
from chefbotd.recording.status import UnreadableRecording
from chefbotd.replay.recorded import NotReplayable, Recorded


class RecordingFiles:
    """The files of one recording, in their order. ``problem`` says where and why reading ended early, once it has.

    Raises:
        NotReplayable: a file cannot be read, or is of another recording than the first.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = with_parts(paths)
        self.problem: str | None = None
        self._about, *others = [_about(path) for path in self._paths]
        for path, about in zip(self._paths[1:], others, strict=True):
            if _recording_of(about) != _recording_of(self._about):
                raise NotReplayable(
                    f"{path}: is of another recording than {self._paths[0]}; replay one at a time: "
                    "its further parts are found by themselves"
                )

    @property
    def configuration(self) -> str:
        """The configuration of the robot then, as JSON.

        Raises:
            NotReplayable: there is none.
        """
        configuration = self._about.get("configuration", {}).get("json")
        if not configuration:
            raise NotReplayable(
                f"{self._paths[0]}: contains no configuration, so chefbotd did not record it, "
                "or its beginning is missing"
            )
        return configuration

    def require_version(self) -> None:
        """See that this is the version that recorded it.

        Raises:
            NotReplayable: it is another one.
        """
        version = self._about.get("chefbotd", {}).get("chefbotd", "of an unknown version")
        if version != __version__:
            raise NotReplayable(
                f"{self._paths[0]}: was recorded by chefbotd {version}, and this is {__version__}, which may do other "
                "things with the same input; --any-version replays it all the same"
            )

    def messages(self) -> Iterator[Recorded]:
        """Every event.

        Raises:
            NotReplayable: one of the files cannot be read.
        """
        for path in self._paths:
            try:
                reader = RecordingReader(path)
                for message in reader.messages(OWN):
                    if message.sequence != REPEATED:
                        yield Recorded(message.sequence, message.schema[len(OWN) :], message.data)
            except UnreadableRecording as problem:
                raise NotReplayable(str(problem)) from problem
            if reader.problem is not None:
                self.problem = f"{path.name}: {reader.problem}"


def _about(path: Path) -> Mapping[str, Mapping[str, str]]:
    try:
        reader = RecordingReader(path)
        reader.read_about()
    except UnreadableRecording as problem:
        raise NotReplayable(str(problem)) from problem
    return reader.metadata


def _recording_of(about: Mapping[str, Mapping[str, str]]) -> tuple[str | None, str | None]:
    """What all parts of a recording have in common."""
    status = about.get("recording", {})
    return status.get("reason"), status.get("clock_offset_ns")


def with_parts(paths: Sequence[Path]) -> tuple[Path, ...]:
    """The files; a first one that stands alone brings those that go on from it, ``NAME_part2.mcap`` and so on."""
    if len(paths) != 1:
        return tuple(paths)
    parts, first = [paths[0]], paths[0]
    while (following := first.with_name(f"{first.stem}_part{len(parts) + 1}{first.suffix}")).is_file():
        parts.append(following)
    return tuple(parts)
