"""The simulator's configuration, and the simulated board that is built from it."""

from pathlib import Path
from typing import Self

from pydantic import Field

from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters
from chefbotd.sim.battery import Battery, BatteryParameters
from chefbotd.sim.infrared import Infrared, InfraredParameters
from chefbotd.sim.launchpad import Launchpad
from chefbotd.sim.motor import BodyParameters, MotorParameters
from chefbotd.sim.plant import Plant
from chefbotd.sim.robot import Robot
from chefbotd.sim.rooms import default_room, load_map
from chefbotd.sim.sensors import ImuParameters, Ultrasonic, UltrasonicParameters
from chefbotd.sim.sketch import BoardParameters, Wiring
from firmware_protocol.codec import VARIANTS, Variant


class WorldParameters(Parameters):
    """Where the robot starts (``world_from_base``), and between which walls; no map is the furnished room."""

    map_path: Path | None = None
    start_x_m: float = 0.0
    start_y_m: float = 0.0
    start_heading_rad: float = 0.0


class SimulationParameters(Parameters):
    """Everything that the simulator can be told; the defaults are the published robot in a furnished room.

    ``wire`` names the variant of the board's lines; a sensor that is None is not wired to the board.
    """

    wire: str = "classic"
    seed: int = Field(1, ge=0)
    step_s: float = Field(0.005, gt=0, le=0.02)
    motor: MotorParameters = MotorParameters()
    body: BodyParameters = BodyParameters()
    world: WorldParameters = WorldParameters()
    ultrasonic: UltrasonicParameters | None = UltrasonicParameters()
    infrared: tuple[InfraredParameters, ...] = ()
    imu: ImuParameters | None = ImuParameters()
    battery: BatteryParameters = BatteryParameters()
    board: BoardParameters = BoardParameters()

    def with_chassis(
        self, *, wheel_radius_m: float, track_width_m: float, counts_per_turn: float, wheels_per_side: int = 1
    ) -> Self:
        """The same simulation of a robot with this chassis.

        Raises:
            ValidationError: a number is out of its range.
        """
        body = self.body.model_dump() | {
            "wheel_radius_m": wheel_radius_m,
            "track_width_m": track_width_m,
            "counts_per_turn": counts_per_turn,
            "wheels_per_side": wheels_per_side,
        }
        return self.model_copy(update={"body": BodyParameters.model_validate(body)})


def build_launchpad(parameters: SimulationParameters, seed: int | None = None) -> Launchpad:
    """A board on a robot in its world, at time 0; ``seed`` stands in for the configured one.

    Raises:
        OSError: the map cannot be read.
        ValueError: the map is none, the start pose is too close to a wall, or the wire is not this robot's.
    """
    start, body = parameters.world, parameters.body
    world = default_room() if start.map_path is None else load_map(start.map_path)
    robot = Robot(
        Plant(parameters.motor, body, parameters.step_s),
        body,
        world,
        Battery.fresh(parameters.battery),
        Pose2D(start.start_x_m, start.start_y_m, start.start_heading_rad),
    )
    wiring = Wiring(
        robot,
        None if parameters.ultrasonic is None else Ultrasonic(parameters.ultrasonic, world),
        parameters.imu,
        body.counts_per_turn,
        _variant(parameters),
        tuple(Infrared(each, world) for each in parameters.infrared),
    )
    return Launchpad(wiring, parameters.board, parameters.seed if seed is None else seed)


def _variant(parameters: SimulationParameters) -> Variant:
    """The wire's variant; raises ``ValueError`` when there is none, or when it has another number of wheels."""
    variant = VARIANTS.get(parameters.wire)
    if variant is None or variant.wheels != parameters.body.wheel_count:
        known = ", ".join(f"{each.name} ({each.wheels} wheels)" for each in VARIANTS.values())
        raise ValueError(
            f"no wire {parameters.wire!r} for a robot with {parameters.body.wheel_count} wheels; there are {known}"
        )
    return variant
