"""Recording on a virtual clock, which waits for no thread."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from chefbotd.recording.intake import Intake
from chefbotd.recording.writer import InlineWriter

if TYPE_CHECKING:
    from chefbotd.recording.recorder import Recorder


def write_inline(intake: Intake, make: "Callable[[], Recorder]", most_bytes: int) -> InlineWriter:
    """Record in the call that leaves the events: a ``start_writer`` for ``running_daemon`` and ``simulated_robot``."""
    return InlineWriter(intake, make, most_bytes)
