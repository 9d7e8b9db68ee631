"""A robot to simulate, and the simulated board that is built for it."""

from collections.abc import Callable
from dataclasses import dataclass, field

from chefbotd.core.geometry import Pose2D
from chefbotd.sim.battery import Battery, Divider
from chefbotd.sim.chassis import PUBLISHED, Chassis
from chefbotd.sim.infrared import Infrared, InfraredParameters
from chefbotd.sim.launchpad import Launchpad
from chefbotd.sim.opening import FirstLineCut
from chefbotd.sim.plant import Plant
from chefbotd.sim.robot import Robot
from chefbotd.sim.rooms import default_room, load_map
from chefbotd.sim.sensors import Ultrasonic, UltrasonicMount
from chefbotd.sim.wiring import Wiring
from chefbotd.sim_parameters.simulation import SimulationParameters
from chefbotd.sim_parameters.sketches import PUBLISHED_SKETCHES, SketchName
from firmware_protocol.codec import CLASSIC, Variant


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
                f"set sim.board.sketch to {SketchName.KHAN.value!r}"
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
