"""A recording's files, as the messages in them: in the order in which they were written, up to where they end."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from chefbotd import __version__
from chefbotd.recording.encoder import REPEATED
from chefbotd.recording.errors import UnreadableRecording
from chefbotd.recording.reader import OWN, RecordingReader
from chefbotd.replay.recorded import NotReplayable, Recorded


class RecordingFiles:
    """The files of one recording, in their order. ``problem`` says where and why reading ended early, once it has.

    Raises:
        NotReplayable: the first file cannot be read.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = with_parts(paths)
        self.problem: str | None = None
        try:
            first = RecordingReader(self._paths[0])
            first.read_about()
        except UnreadableRecording as problem:
            raise NotReplayable(str(problem)) from problem
        self._about = first.metadata

    @property
    def configuration(self) -> str:
        """The configuration of the robot then, as JSON.

        Raises:
            NotReplayable: there is none.
        """
        found = self._about.get("configuration", {}).get("json")
        if not found:
            raise NotReplayable(
                f"{self._paths[0]}: contains no configuration, so chefbotd did not record it, "
                "or its beginning is missing"
            )
        return found

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


def with_parts(paths: Sequence[Path]) -> tuple[Path, ...]:
    """The files; a first one that stands alone brings those that go on from it, ``NAME_part2.mcap`` and so on."""
    if len(paths) != 1:
        return tuple(paths)
    found, first = [paths[0]], paths[0]
    while (following := first.with_name(f"{first.stem}_part{len(found) + 1}{first.suffix}")).is_file():
        found.append(following)
    return tuple(found)
