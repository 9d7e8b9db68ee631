"""The shape and the masses of the robot's body."""

from pydantic import Field

from chefbotd.core.parameters import Parameters


class BodyParameters(Parameters):
    """The body's shape and masses; only the robot's description needs them.

    The body is a box, or a cylinder of diameter ``length_m`` where ``width_m`` is left out. It is centred over the
    middle of the wheels, its underside ``ground_clearance_m`` above the floor. Without a mass a link has no inertia.
    """

    length_m: float = Field(gt=0, le=5)
    width_m: float | None = Field(default=None, gt=0, le=5)
    height_m: float = Field(gt=0, le=5)
    ground_clearance_m: float = Field(default=0.0, ge=0, le=5)
    mass_kg: float | None = Field(default=None, gt=0, le=500)
    wheel_width_m: float = Field(default=0.025, gt=0, le=1)
    wheel_mass_kg: float | None = Field(default=None, gt=0, le=100)
