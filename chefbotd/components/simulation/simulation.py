"""A robot to simulate, and the simulated board that is built for it."""

from collections.abc import Callable

from msgspec import field

from chefbotd.components.simulation.board import Launchpad, SimulatedBoard
from chefbotd.components.simulation.chassis import PUBLISHED, Chassis
from chefbotd.components.simulation.crowd import Crowd
from chefbotd.components.simulation.emulated import EmulatedLaunchpad
from chefbotd.components.simulation.firmware import FirmwareBoard
from chefbotd.components.simulation.ground import Backlash, Slip
from chefbotd.components.simulation.lidar_devices import SimulatedLd19, SimulatedRplidar
from chefbotd.components.simulation.parameters.simulation import (
    Physics,
    SimulationParameters,
    WorldParameters,
)
from chefbotd.components.simulation.parameters.sketches import SketchName
from chefbotd.components.simulation.planar import PlanarRobot
from chefbotd.components.simulation.plant import Plant
from chefbotd.components.simulation.robot import Robot
from chefbotd.components.simulation.rooms import scene_of
from chefbotd.components.simulation.scene import Scene
from chefbotd.components.simulation.sensors import (
    Battery,
    Divider,
    Infrared,
    InfraredMount,
    Ultrasonic,
    UltrasonicMount,
)
from chefbotd.components.simulation.sketch import Wiring
from chefbotd.components.simulation.spinning import LidarMount, LidarWire, Sight, SpinningLidar
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record
from firmware_protocol.codec import CLASSIC, Variant

RANGE_SENSORS_M = 0.15
"""The height at which ultrasonic and infrared sensors look (assumed): beneath a table's top."""


class Simulation(Record, frozen=True):
    """A robot to simulate: its wire, wheels and sensors, and all else; a sensor that is None is not wired to the board.

    Each of ``lidars`` is on a line of its own.

    Raises:
        ValueError: the wire is another robot's or another sketch's, or no two wheels of a side share the wheelbase.
    """

    parameters: SimulationParameters = field(default_factory=SimulationParameters)
    variant: Variant = CLASSIC
    chassis: Chassis = PUBLISHED
    line_rate_bytes_s: float = 11_520.0
    divider: Divider = field(default_factory=Divider)
    ultrasonic: UltrasonicMount | None = field(default_factory=UltrasonicMount)
    infrared: tuple[InfraredMount, ...] = ()
    has_imu: bool = True
    lidars: tuple[LidarMount, ...] = ()

    def __post_init__(self) -> None:
        wheels, wheelbase_m = self.chassis.wheels, self.parameters.body.wheelbase_m
        if self.variant.wheels != len(wheels):
            raise ValueError(
                f"the wire {self.variant.name!r} has {self.variant.wheels} wheels, the robot {len(wheels)}"
            )
        sketch = self.parameters.board.sketch
        if sketch is not SketchName.KHAN and self.variant.name != CLASSIC.name:
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


def build_launchpad(simulation: Simulation, seed: int | None = None) -> SimulatedBoard:
    """A board on a robot in its world, at time 0; ``seed`` stands in for the configured one.

    Raises:
        OSError: the map cannot be read, our own firmware cannot be compiled, or its emulator or image is not built.
        ValueError: the map is none, or the start pose is too close to a wall.
        ModuleNotFoundError: the physics is MuJoCo's, which is not installed.
    """
    parameters = simulation.parameters
    seed = parameters.seed if seed is None else seed
    true = parameters.true
    scene = scene_of(parameters.world.map_path, parameters.world.closed_doors)
    crowd = Crowd(parameters.people, parameters.things, seed)
    seen = scene.at(RANGE_SENSORS_M, crowd)
    robot = _robot(simulation, scene, crowd, seed)
    mount = simulation.ultrasonic
    wiring = Wiring(
        robot,
        simulation.chassis,
        None
        if mount is None
        else Ultrasonic(
            parameters.ultrasonic,
            mount,
            seen,
            true.ultrasonic_offset_m,
            far_echo_share=true.far_echo_share,
            seed=seed,
        ),
        parameters.imu if simulation.has_imu else None,
        simulation.divider,
        simulation.variant,
        tuple(
            Infrared(
                sensor,
                seen,
                noise_v=parameters.infrared.noise_v,
                offset_m=true.infrared_offset_m,
                glitch_share=parameters.infrared.glitch_share + true.infrared_glitch_share,
                seed=seed,
            )
            for sensor in simulation.infrared
        ),
        true.imu,
    )
    program: type[EmulatedLaunchpad | FirmwareBoard | Launchpad] = Launchpad
    if parameters.board.sketch is SketchName.EMULATED:
        program = EmulatedLaunchpad
    elif parameters.board.sketch is SketchName.CHEFBOT:
        program = FirmwareBoard
    return program(wiring, parameters.board, seed, simulation.line_rate_bytes_s)


def _robot(simulation: Simulation, scene: Scene, crowd: Crowd, seed: int) -> Robot:
    parameters, chassis = simulation.parameters, simulation.chassis
    motor, body = parameters.motor, parameters.body
    plant = Plant(motor, body, parameters.step_s, chassis)
    battery, start = Battery.fresh(parameters.battery), start_pose(parameters.world, scene.start)
    slip = Slip(parameters.true, chassis, seed)
    if parameters.physics is Physics.MUJOCO:
        from chefbotd.components.simulation.mujoco_robot import MujocoRobot  # an extra

        floor = parameters.floor
        return MujocoRobot(plant, motor, body, chassis, scene, floor, battery, start, slip, crowd)
    world = scene.below(body.height_m, crowd)
    return PlanarRobot(plant, body, world, battery, start, Backlash(chassis), slip, crowd)


def build_lidars(simulation: Simulation, seed: int | None = None) -> dict[str, SpinningLidar]:
    """The robot's lidars by their names, at time 0.

    Raises:
        OSError: the map cannot be read.
        ValueError: the map is none.
    """
    if not simulation.lidars:
        return {}
    parameters = simulation.parameters
    seed = parameters.seed if seed is None else seed
    scene = scene_of(parameters.world.map_path, parameters.world.closed_doors)
    return {
        mount.name: (SimulatedLd19 if mount.wire is LidarWire.LD19 else SimulatedRplidar)(
            parameters.lidar, mount, Sight(scene, mount.height_m, parameters.lidar), seed + number
        )
        for number, mount in enumerate(simulation.lidars)
    }


def start_pose(configured: WorldParameters, default: Pose2D) -> Pose2D:
    """Where the robot starts: as configured, and as the building says where nothing is."""
    x_m, y_m, heading_rad = configured.start_x_m, configured.start_y_m, configured.start_heading_rad
    return Pose2D(
        default.x_m if x_m is None else x_m,
        default.y_m if y_m is None else y_m,
        default.heading_rad if heading_rad is None else heading_rad,
    )


class FirstLineCut:
    """Passes on what the board sends; of the first line that each new host would hear, only the second half.

    ``host`` gives the one that has the port open, None if nobody has.
    """

    def __init__(self, send: Callable[[bytes], None], host: Callable[[], object | None]) -> None:
        self._send, self._host = send, host
        self._heard_by: object | None = None

    def __call__(self, data: bytes) -> None:
        """One or more whole lines."""
        host = self._host()
        if host is not None and host is not self._heard_by:
            data = data[(data.find(b"\n") + 1) // 2 :]
        self._heard_by = host
        self._send(data)
