"""People who walk around in the simulated rooms, and things in the way."""

from typing import Self

from pydantic import Field, model_validator

from chefbotd.core.parameters import Parameters


class PersonParameters(Parameters):
    """A person who walks along a path of points (x, y), back and forth or in circles, with a pause at each end.

    ``stops_for_robot``: the person stops rather than come closer to the robot than ``min_distance_m``; otherwise it
    ignores the robot.
    Speeds and pauses vary by a tenth (a standard deviation), drawn from the seed.
    """

    path_m: tuple[tuple[float, float], ...] = Field(min_length=1)
    speed_m_s: float = Field(0.8, gt=0, le=3)
    radius_m: float = Field(0.25, gt=0, le=1)
    start_m: float = Field(0.0, ge=0)
    pause_s: float = Field(1.0, ge=0, le=3600)
    stops_for_robot: bool = True
    min_distance_m: float = Field(0.3, ge=0, le=5)
    closed_path: bool = False

    @model_validator(mode="after")
    def _goes_somewhere(self) -> Self:
        if self.closed_path and len(self.path_m) < 3:
            raise ValueError(f"going round needs three points at least, got {len(self.path_m)}")
        return self


class ThingParameters(Parameters):
    """A chair, a bag: something round on the floor that is on no map."""

    x_m: float
    y_m: float
    radius_m: float = Field(0.25, gt=0, le=2)
