"""Who may do what: three roles, each with everything that the ones before it may."""

from enum import StrEnum


class Role(StrEnum):
    """``observe`` looks, and stops the robot; ``drive`` moves it; ``admin`` changes how it works."""

    OBSERVE = "observe"
    DRIVE = "drive"
    ADMIN = "admin"

    def allows(self, needed: "Role") -> bool:
        """Whether whoever has this role may do what needs another."""
        return _RANK[self] >= _RANK[needed]


_RANK = {role: rank for rank, role in enumerate(Role)}
