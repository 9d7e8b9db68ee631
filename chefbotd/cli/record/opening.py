"""Opens recordings for the commands, and reports a file that is not a recording."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.cli.common.extras import extra

with extra("recording", "mcap", "zstandard", "lz4"):
    from chefbotd.recording.reader import RecordingReader

from chefbotd.recording.errors import UnreadableRecording


@contextmanager
def opened(path: Path) -> Iterator[RecordingReader]:
    """A reader of the file.

    Raises:
        ProgramError: the file is no recording, or cannot be read.
    """
    try:
        yield RecordingReader(path)
    except UnreadableRecording as error:
        raise ProgramError(Exit.FAILED, str(error)) from error
