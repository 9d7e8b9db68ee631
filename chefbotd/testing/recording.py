"""Recording on a virtual clock, which waits for no thread."""

from chefbotd.components.recording.writer import InlineWriter, MakeRecorder


def write_inline(make: MakeRecorder, most_bytes: int) -> InlineWriter:
    """Record in the call that leaves the events: a ``start_writer`` for ``running_daemon`` and ``simulated_robot``."""
    return InlineWriter(make, most_bytes)
