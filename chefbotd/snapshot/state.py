"""What a daemon remembers, as an event; and back into a daemon of a replay."""

from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING

from chefbotd.core.events.inputs import StateRecorded
from chefbotd.entries import Entries

if TYPE_CHECKING:
    from chefbotd.snapshot.restorable import Restorable


class DaemonState:
    """``parts`` remember something; ``waiting`` are the tasks of requests that can go on from it.

    Requests of the methods ``harmless`` change none of the parts, so that it does not matter how far one of them is.
    """

    def __init__(
        self,
        entries: Entries,
        parts: Mapping[str, object],
        waiting: Callable[[], Collection[str]],
        harmless: Collection[str],
    ) -> None:
        self._entries, self.parts = entries, parts
        self._waiting, self._harmless = waiting, harmless

    @cached_property
    def restorable(self) -> "Restorable":
        """What a state may name; it takes some milliseconds once."""
        from chefbotd.snapshot.restorable import Restorable

        return Restorable(self.parts.values())

    @property
    def is_settled(self) -> bool:
        """Whether nothing is under way that a state cannot have in it."""
        return next(self._under_way(), None) is None

    def record(self) -> StateRecorded:
        """The state now, between two entries."""
        from chefbotd.snapshot.capture import Capture  # not at the start: see ``features.recording.making``

        capture = Capture(self.restorable)
        parts = capture.capture_parts(self.parts)
        is_open = tuple(name for name, session in self._entries.links.items() if session.is_open)
        left_out = (*self._under_way(), *capture.left_out)
        return StateRecorded(self._entries.now_s(), parts, is_open, left_out)

    def _under_way(self) -> Iterator[str]:
        waiting = self._waiting()
        for name, steps in self._entries.running.items():
            if name in waiting or steps.what in self._harmless:
                continue
            if steps.what:
                yield f"{name} ({steps.what}) is under way"
            elif not steps.is_at_home:
                yield f"the service {name} is in the middle of something"
