"""Which commands the board can have had in force while a reading was taken.

Whoever judges a reading asks here, because the newest command says little about it. A published sketch reads all waiting
bytes when a cycle begins, prints time and encoders, may wait a second for an ultrasonic echo, and only then puts the
last command that it read in force. So while a cycle lasts, the command of the cycle before is still in force at first.
A board that reads at once, such as our own firmware, only knows newer commands sooner.

What is certain is the oldest command that may still be in force. It comes from two sources:

- time: a command that was written before the last cycle began has been read in that cycle, and is in force when the
  next begins. A line that waited in a buffer is judged at the time at which it was taken, not at which it came;
- the board's echo, once it is known to follow the commands: it names the command in force, also where one was lost.

Between that command and the newest that the board can have read, every one may have been in force.
"""

import math

from chefbotd.core.record import MutableState, Record, replace

Duty = tuple[int, ...]

WIRE_S = 0.02
"""A command may be so long on its way, and a reading's stamp so far off."""

BACKLOG_S = 0.1
"""After a longer pause the lines of a board without a clock may have waited: when they were taken is not known."""

MOST_COMMANDS = 256
"""Different commands are remembered: more than go out at 200 a second while the sketch waits a second for an echo."""


class WrittenCommand(Record, frozen=True):
    """A command that was written from ``since_s`` on.

    ``effort`` is the duty of each wheel as a share of the range (see ``Drive.effort``), ``setpoint_m_s`` the speed of
    each rim that it was meant for.
    """

    since_s: float
    duty: Duty
    effort: tuple[float, ...]
    setpoint_m_s: tuple[float, ...]


class Envelope(Record, frozen=True):
    """What the commands that can have been in force over a reading have in common.

    ``effort`` is the least of each wheel, with the direction of the newest. A wheel that ``may_turn_round`` can have
    been driven either way at that; empty where none can. ``asked_m_s`` is the speed of each rim that is farthest from
    rest; ``is_steady``: all of them asked for the same.
    """

    effort: tuple[float, ...]
    may_turn_round: tuple[bool, ...]
    asked_m_s: tuple[float, ...]
    is_steady: bool = True


class InForce(MutableState):
    """The commands that were written, newest first, and the board's last cycles.

    The oldest command that may have been in force at the last good reading was written at ``settled_s`` or earlier.
    ``taken_s``, ``before_s`` and ``earlier_s`` are when the last encoder lines were taken. Commands up to ``written_s``
    have left; later ones are held back. The echo of ``shown_at_s`` names the command written at ``shown_s`` (None:
    none that was sent, so the board obeys something else). ``acts_at_once``: commands do not wait for the next cycle.
    A board that ``has_clock`` sends its time; one without has lines from a pause that began at ``waits_from_s`` until
    ``waits_until_s``.
    """

    commands: tuple[WrittenCommand, ...] = ()
    settled_s: float = float("-inf")
    taken_s: float = float("-inf")
    before_s: float = float("-inf")
    earlier_s: float = float("-inf")
    written_s: float = float("inf")
    shown_s: float | None = None
    shown_at_s: float = float("-inf")
    acts_at_once: bool = False
    arrived_s: float = float("-inf")
    waits_from_s: float = float("-inf")
    waits_until_s: float = float("-inf")
    has_clock: bool = True

    def note_way(self, *, is_held_back: bool) -> None:
        """The newest command goes to the board again, or another one; ``is_held_back`` as in ``note_command``."""
        if not is_held_back:
            self.written_s = math.inf
        elif self.commands and self.commands[0].since_s < self.written_s:
            self.written_s = self.commands[0].since_s

    def note_command(self, command: WrittenCommand, *, is_held_back: bool = False) -> None:
        """A command goes to the board; ``is_held_back``: it may still wait on this side of the wire."""
        self.note_way(is_held_back=is_held_back)
        if self.commands:
            newest = self.commands[0]
            if newest.duty == command.duty and newest.setpoint_m_s == command.setpoint_m_s:
                return
        self.commands = (command, *self.commands[: MOST_COMMANDS - 1])

    def note_echo(self, shown_at_s: float, shown: tuple[float, ...]) -> None:
        """The board, whose echo is believed, says which command is in force.

        Of several equal commands it is taken for the oldest that can still be in force. Where it is none of these, it
        is the newest of the earlier ones: the board did not get what followed.
        """
        shown_s: float | None = None
        settled_s = self.settled_s
        for command in self.commands:
            if shown_s is not None and command.since_s < settled_s:
                break
            if command.duty == shown:
                shown_s = command.since_s
        self.shown_s, self.shown_at_s = shown_s, shown_at_s
        if shown_s is not None and shown_s > self.taken_s + WIRE_S:
            self.acts_at_once = True

    def note_line(self, taken_s: float, arrived_s: float, *, has_clock: bool) -> None:
        """An encoder line has come. Where the board has no clock, it may have waited for as long as none came."""
        self.has_clock = has_clock
        if not has_clock:
            if float("inf") > arrived_s - self.arrived_s > BACKLOG_S:
                self.waits_from_s, self.waits_until_s = self.arrived_s, arrived_s + BACKLOG_S
            if arrived_s <= self.waits_until_s:
                taken_s = self.waits_from_s
        self.arrived_s = arrived_s
        self.earlier_s, self.before_s, self.taken_s = self.before_s, self.taken_s, taken_s

    def over_reading(self) -> Envelope | None:
        """What can have been in force from the last good reading to the line that came last; None: nothing yet."""
        from_s, until_s = self.settled_s, (self.taken_s if self.acts_at_once else self.before_s) + WIRE_S
        if self.arrived_s <= self.waits_until_s:
            until_s = self.arrived_s
        is_shown = self.shown_at_s >= self.before_s
        if not is_shown:
            read_s = self.before_s - WIRE_S
            self.settled_s = read_s if read_s < self.written_s else self.written_s
        elif self.shown_s is not None:
            self.settled_s = self.shown_s
        envelope: Envelope | None = None
        for command in self.commands:
            if envelope is not None:
                envelope = _widen(envelope, command)
            elif command.since_s <= until_s or command.since_s <= from_s:
                envelope = Envelope(command.effort, (), command.setpoint_m_s)
            if command.since_s <= from_s:
                break
        if (
            envelope is not None and is_shown and self.shown_s is None
        ):  # what it was not sent may drive no wheel
            return replace(envelope, effort=(0.0,) * len(envelope.effort))
        return envelope

    def likely_m_s(self) -> tuple[float, ...] | None:
        """The mean speed of each rim that was asked for between the last two lines; None before there are both.

        Until the board's echo in between, the command of the cycle before is in force, then the one that was read last.
        """
        if not self.commands or not -math.inf < self.before_s < self.taken_s:
            return None
        switched_s = self.shown_at_s if self.before_s < self.shown_at_s < self.taken_s else self.taken_s
        share = (switched_s - self.before_s) / (self.taken_s - self.before_s)
        first, second = self._read_by(self.earlier_s), self._read_by(self.before_s)
        pairs = zip(first.setpoint_m_s, second.setpoint_m_s, strict=True)
        return tuple([share * old + (1 - share) * new for old, new in pairs])

    def _read_by(self, cycle_s: float) -> WrittenCommand:
        """The newest command that a cycle has read which began then; the oldest one known where none was that early."""
        for command in self.commands:
            if command.since_s <= cycle_s:
                return command
        return self.commands[-1]


def _widen(envelope: Envelope, command: WrittenCommand) -> Envelope:
    """The envelope with one more command, an older one."""
    effort, asked_m_s = list(envelope.effort), list(envelope.asked_m_s)
    may_turn_round = list(envelope.may_turn_round or (False,) * len(effort))
    for wheel, (share, setpoint_m_s) in enumerate(zip(command.effort, command.setpoint_m_s, strict=True)):
        least = effort[wheel]
        if share * least < 0:
            may_turn_round[wheel] = True
        if share * share < least * least:
            effort[wheel] = math.copysign(share, least)
        if setpoint_m_s * setpoint_m_s > asked_m_s[wheel] * asked_m_s[wheel]:
            asked_m_s[wheel] = setpoint_m_s
    is_steady = envelope.is_steady and command.setpoint_m_s == envelope.asked_m_s
    either_way = tuple(may_turn_round) if any(may_turn_round) else ()
    return Envelope(tuple(effort), either_way, tuple(asked_m_s), is_steady)
