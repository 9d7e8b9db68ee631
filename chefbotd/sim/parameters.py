"""The simulator's configuration, and the simulated board that is built from it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import Field

from chefbotd.core.geometry import Pose2D
from chefbotd.core.parameters import Parameters
from chefbotd.sim.battery import Battery, BatteryParameters, Divider
from chefbotd.sim.chassis import PUBLISHED, Chassis
from chefbotd.sim.infrared import Infrared, InfraredParameters
from chefbotd.sim.launchpad import Launchpad
from chefbotd.sim.motor import BodyParameters, MotorParameters
from chefbotd.sim.opening import FirstLineCut
from chefbotd.sim.plant import Plant
from chefbotd.sim.robot import Robot
from chefbotd.sim.rooms import default_room, load_map
from chefbotd.sim.sensors import ImuParameters, Ultrasonic, UltrasonicMount, UltrasonicParameters
from chefbotd.sim.sketches import PUBLISHED_SKETCHES, BoardParameters, SketchName
from chefbotd.sim.wiring import Wiring
from firmware_protocol.codec import CLASSIC, Variant


class WorldParameters(Parameters):
    """Where the robot starts (``world_from_base``), and between which walls; no map is the furnished room."""

    map_path: Path | None = None
    start_x_m: float = 0.0
    start_y_m: float = 0.0
    start_heading_rad: float = 0.0


class SimulationParameters(Parameters):
    """What only a simulation needs to be told of a robot; the defaults are the published one in a furnished room."""

    seed: int = Field(1, ge=0)
    step_s: float = Field(0.005, gt=0, le=0.02)
    motor: MotorParameters = MotorParameters()
    body: BodyParameters = BodyParameters()
    world: WorldParameters = WorldParameters()
    ultrasonic: UltrasonicParameters = UltrasonicParameters()
    imu: ImuParameters = ImuParameters()
    battery: BatteryParameters = BatteryParameters()
    board: BoardParameters = BoardParameters()


@dataclass(frozen=True, slots=True)
class Simulation:
    """A robot to simulate: its wire, wheels and sensors, and all else; a sensor that is None is not wired to the board.

    Raises:
        ValueError: the wire is another robot's or another sketch's, or no two wheels of a side share the wheelbase.
    """

    parameters: SimulationParameters = field(default_factory=SimulationParameters)
    variant: Variant = CLASSIC
    chassis: Chassis = PUBLISHED
    line_rate_bytes_s: float = 11_520.0
    divider: Divider = field(default_factory=Divider)
    ultrasonic: UltrasonicMount | None = field(default_factory=UltrasonicMount)
    infrared: tuple[InfraredParameters, ...] = ()
    has_imu: bool = True

    def __post_init__(self) -> None:
        wheels, wheelbase_m = self.chassis.wheels, self.parameters.body.wheelbase_m
        if self.variant.wheels != len(wheels):
            raise ValueError(
                f"the wire {self.variant.name!r} has {self.variant.wheels} wheels, the robot {len(wheels)}"
            )
        sketch = self.parameters.board.sketch
        if sketch in PUBLISHED_SKETCHES and self.variant.name != CLASSIC.name:
            raise ValueError(
                f"the sketch {sketch.value!r} speaks the wire {CLASSIC.name!r}, the robot {self.variant.name!r}: "
                f"set sim.board.sketch to {SketchName.OWN.value!r}"
            )
        if wheelbase_m and len(wheels) == 2:
            raise ValueError(
                f"sim.body.wheelbase_m {wheelbase_m:g} needs a side with two wheels, there is one on each"
            )


def board_sender(
    simulation: Simulation, send: Callable[[bytes], None], host: Callable[[], object | None]
) -> Callable[[bytes], None]:
    """What the board sends with, to whoever has its port open."""
    return FirstLineCut(send, host) if simulation.parameters.board.cuts_first_line else send


def build_launchpad(simulation: Simulation, seed: int | None = None) -> Launchpad:
    """A board on a robot in its world, at time 0; ``seed`` stands in for the configured one.

    Raises:
        OSError: the map cannot be read.
        ValueError: the map is none, or the start pose is too close to a wall.
    """
    parameters = simulation.parameters
    start, body = parameters.world, parameters.body
    world = default_room() if start.map_path is None else load_map(start.map_path)
    robot = Robot(
        Plant(parameters.motor, body, parameters.step_s, simulation.chassis),
        body,
        world,
        Battery.fresh(parameters.battery),
        Pose2D(start.start_x_m, start.start_y_m, start.start_heading_rad),
    )
    mount = simulation.ultrasonic
    wiring = Wiring(
        robot,
        simulation.chassis,
        None if mount is None else Ultrasonic(parameters.ultrasonic, mount, world),
        parameters.imu if simulation.has_imu else None,
        simulation.divider,
        simulation.variant,
        tuple(Infrared(each, world) for each in simulation.infrared),
    )
    seed = parameters.seed if seed is None else seed
    return Launchpad(wiring, parameters.board, seed, simulation.line_rate_bytes_s)
