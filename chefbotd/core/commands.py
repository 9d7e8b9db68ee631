"""What a command is answered with when it is not carried out."""

from enum import StrEnum


class RefusalKind(StrEnum):
    """Stable names for why a command was refused; clients branch on these."""

    DISARMED = "disarmed"
    ESTOPPED = "estopped"
    LINK_DOWN = "link_down"
    UNKNOWN_SOURCE = "unknown_source"
    UNKNOWN_WHEEL = "unknown_wheel"
    OUT_OF_RANGE = "out_of_range"
    NOTHING_TO_UNDO = "nothing_to_undo"


class Refused(Exception):
    """A command that was understood and not carried out: nothing moved, nothing changed."""

    def __init__(self, kind: RefusalKind, message: str) -> None:
        super().__init__(message)
        self.kind = kind
