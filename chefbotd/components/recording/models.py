"""Recording: the files, and the topic ``recording``."""

from pydantic import Field

from chefbotd.components.recording.status import RecordedFile
from chefbotd.core.events.robot import RecordingChanged, RecordingData
from chefbotd.core.record import Record
from chefbotd.rpc.models import Params
from chefbotd.rpc.topics import Topic, same_names


class StartRecordingParams(Params):
    """The beginning of the file's name."""

    name: str | None = Field(None, min_length=1, max_length=64, description="'recording' if none is given")


class SaveRingParams(Params):
    """The reason, as a part of the file's name."""

    reason: str | None = Field(None, min_length=1, max_length=64, description="'asked' if none is given")


class RecordingStarted(Record, frozen=True):
    """The file that is being written, on the robot's computer."""

    name: str
    file: str


class RecordingEnded(Record, frozen=True):
    """The last file of the recording, and the sums of all its files; ``dropped`` counts the missing events."""

    name: str
    file: str
    seconds: float
    size_bytes: int
    messages: int
    dropped: int


class RingSaved(Record, frozen=True):
    """The file with the last minutes."""

    file: str
    seconds: float


class RecordingList(Record, frozen=True):
    """Every recording, the newest first."""

    folder: str
    files: tuple[RecordedFile, ...]


TOPICS = (
    Topic("recording", (RecordingChanged,), RecordingData, same_names(RecordingData), always_known=True),
)
