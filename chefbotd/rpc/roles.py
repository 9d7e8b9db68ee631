"""The three roles of clients. Each may do everything that the previous ones may."""

from enum import StrEnum


class Role(StrEnum):
    """``observe`` looks, and stops the robot; ``drive`` moves it; ``admin`` changes how it works."""

    rank: int

    OBSERVE = "observe"
    DRIVE = "drive"
    ADMIN = "admin"

    def __init__(self, _: str) -> None:
        self.rank = len(type(self).__members__)

    def allows(self, needed: "Role") -> bool:
        """Whether whoever has this role may do what needs another."""
        return self.rank >= needed.rank
