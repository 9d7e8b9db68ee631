"""The pose that is kept from one run to the next, as text and as values. Needs no numpy."""

import math
from typing import Literal, Self

from pydantic import Field, ValidationError, model_validator

from chefbotd.core.parameters import Parameters

MOVED_M, MOVED_RAD = 0.1, 0.1
"""One sigma of how far a robot may have been nudged while nobody watched."""

MOST_M = 1e4


class NotASavedPose(ValueError):
    """Text that no saved pose is in; it says why."""


class SavedPose(Parameters):
    """Where the robot was on which version of which map, and the covariance over x, y and heading, row by row."""

    format: Literal[1] = 1
    map: str = Field(min_length=1)
    version: int = Field(ge=1)
    x_m: float = Field(ge=-MOST_M, le=MOST_M)
    y_m: float = Field(ge=-MOST_M, le=MOST_M)
    heading_rad: float = Field(ge=-math.tau, le=math.tau)
    covariance: tuple[float, ...] = Field(min_length=9, max_length=9)

    @model_validator(mode="after")
    def _is_a_covariance(self) -> Self:
        rows = [self.covariance[3 * k : 3 * k + 3] for k in range(3)]
        if any(not 0 <= rows[k][k] <= MOST_M for k in range(3)):
            raise ValueError(f"variances are from 0 to {MOST_M:g}, got {[rows[k][k] for k in range(3)]}")
        for i in range(3):
            for k in range(i):
                if abs(rows[i][k] - rows[k][i]) > 1e-9 or rows[i][k] ** 2 > rows[i][i] * rows[k][k] * (
                    1 + 1e-6
                ):
                    raise ValueError(
                        f"a covariance is symmetric and no variance is exceeded, got {self.covariance}"
                    )
        return self

    def loosened(self) -> tuple[float, ...]:
        """The covariance after a time in which somebody may have moved the robot a bit."""
        added = {0: MOVED_M**2, 4: MOVED_M**2, 8: MOVED_RAD**2}
        return tuple(value + added.get(k, 0.0) for k, value in enumerate(self.covariance))


def to_text(pose: SavedPose) -> str:
    """As it is kept."""
    return pose.model_dump_json() + "\n"


def from_text(text: str) -> SavedPose:
    """What was kept.

    Raises:
        NotASavedPose: the text is not what ``to_text`` makes.
    """
    try:
        return SavedPose.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "text"
        raise NotASavedPose(f"not a saved pose: {where}: {first['msg']}") from error
