"""A simulated ChefBot that is wrong in everything calibrates itself, on the virtual clock.

It is drawn at random from a seed (``[sim.true]``), stands in a furnished flat, and knows only its configuration. A
person who reads the voltmeter is simulated, too. Before and after, it drives a square of 4 m both ways through an empty
hall, where its odometry is held against the truth.
"""

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Collection, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final

from chefbotd.cli.drive.course import Leg, square
from chefbotd.cli.drive.course_driver import CourseDriver
from chefbotd.client import Client
from chefbotd.client.models import CalibrationStep
from chefbotd.components.calibration.events import Ask, StepResult
from chefbotd.components.simulation.parameters.true import TrueParameters
from chefbotd.components.simulation.process.simulated_robot import nominal_battery, sim_of, true_of
from chefbotd.components.simulation.process.true_values import true_values
from chefbotd.core.geometry import Pose2D, wrap_angle
from chefbotd.core.record import Record
from chefbotd.settings import Settings, load, packaged
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot

SIDE_M: Final = 4.0
HALL_M: Final = 7.0
START: Final = {"map_path": Path("flat"), "start_x_m": 6.1, "start_y_m": 1.6}
"""Between kitchen and living room, where the flat has most room: 0.75 m around the robot."""

ROBOT: Final = "chefbot_lidar"
Say = Callable[[str], None]


class SquareError(Record, frozen=True):
    """How far odometry is off the truth at the end of a square, counter-clockwise or clockwise."""

    clockwise: bool
    distance_m: float
    heading_rad: float


class Calibrated(Record, frozen=True):
    """What came of it; ``true`` are the true values by the keys of the estimates, ``robot_s`` is the robot's time.

    ``slip_rad`` is the standard deviation of the heading at a square's end by random slip alone: no calibration helps.
    """

    seed: int
    results: tuple[StepResult, ...]
    true: Mapping[str, float]
    before: tuple[SquareError, ...]
    after: tuple[SquareError, ...]
    slip_rad: float
    robot_s: float
    config: Path
    difference: str


async def calibrate(
    seed: int,
    out: Path,
    say: Say,
    *,
    squares: bool = True,
    compares: bool = True,
    steps: Collection[str] | None = None,
    side_m: float = SIDE_M,
) -> Calibrated:
    """Calibrate the robot of this seed; its configuration in ``out`` is written to.

    ``squares`` with sides of ``side_m`` are driven afterwards, and if it ``compares``, before as well. Only these
    ``steps`` are done (None: all).
    """
    config = out / "robot.toml"
    config.write_bytes(packaged(ROBOT).read_bytes())
    nominal = load(config)
    drawn = sim_of(nominal).true.model_copy(update={"drawn": "imperfect", "seed": seed})
    true = true_of(_simulated(nominal, drawn))  # all of it given: another configuration is the same robot
    before = await _squares(nominal, true, side_m, out, say) if squares and compares else ()
    async with simulated_robot(_simulated(nominal, true, START), config_file=config) as robot:
        began_s = asyncio.get_running_loop().time()
        results = await _all_steps(robot, true, say, steps)
        robot_s = asyncio.get_running_loop().time() - began_s
        applied = await robot.client.apply_calibration()
    after = await _squares(load(config), true, side_m, out, say) if squares else ()
    estimates = {estimate.key: estimate.after for result in results for estimate in result.estimates}
    divider = nominal_battery(nominal).divider_ratio
    seen = divider / estimates.get(
        "battery.divider_ratio", divider
    )  # the motors' step has the battery's result
    voltage_v = estimates.get("drive.motor_voltage_v", 12.0) * seen
    values = true_values(_simulated(nominal, true), voltage_v)
    return Calibrated(
        seed,
        results,
        {key: values[key] for key in estimates if key in values},
        before,
        after,
        _slip_rad(true, side_m),
        robot_s,
        config,
        applied.difference,
    )


def _simulated(
    settings: Settings, true: TrueParameters, world: Mapping[str, Any] | None = None, **board: Any
) -> Settings:
    """The settings of a robot that is so, in this world."""
    sim = sim_of(settings).model_copy(update={"true": true})
    sim = sim.model_copy(
        update={
            "world": sim.world.model_copy(update=dict(world or {})),
            "board": sim.board.model_copy(update=board),
        }
    )
    return settings.model_copy(update={"sim": sim})


async def _all_steps(
    robot: SimulatedRobot, true: TrueParameters, say: Say, chosen: Collection[str] | None
) -> tuple[StepResult, ...]:
    client = robot.client
    await client.arm()
    await asyncio.sleep(2.0)
    report = await client.get_calibration()
    results = []
    for step in report.steps:
        if step.on_request if chosen is None else step.name not in chosen:
            continue
        if step.missing:
            say(f"{step.name}: left out, {step.missing}")
            continue
        if step.name == "encoders":
            say(f"{step.name}: left out, nobody can turn a simulated wheel by hand")
            continue
        results.append(await _step(robot, step, say))
    return tuple(results)


async def _step(robot: SimulatedRobot, step: CalibrationStep, say: Say) -> StepResult:
    async with _person(robot):
        result = await robot.client.calibrate(step.name)
    say(f"{step.name}: {result.status.replace('_', ' ')}" + (f" ({result.reason})" if result.reason else ""))
    return result


@asynccontextmanager
async def _person(robot: SimulatedRobot) -> AsyncIterator[None]:
    """Somebody beside the robot, who answers what it asks by looking at it."""

    async def answer_all() -> None:
        asked: Ask | None = None
        async for event in robot.client.subscribe("calibration"):
            question = event.data.question
            if question is not None and question != asked:
                await robot.client.answer_calibration(question.key, _seen(robot, question))
            asked = question

    answering = asyncio.create_task(answer_all())
    try:
        yield
    finally:
        answering.cancel()


def _seen(robot: SimulatedRobot, question: Ask) -> float:
    """What a person reads: the voltmeter at the battery, to 10 mV."""
    if question.unit == "V":
        return round(robot.board.terminal_v, 2)
    raise NotImplementedError(f"nobody can answer {question.key}")


async def _squares(
    settings: Settings, true: TrueParameters, side_m: float, out: Path, say: Say
) -> tuple[SquareError, ...]:
    """Both ways round, in a hall that is larger than the ultrasonic sensor's range."""
    errors = []
    settings = settings.model_copy(update={"lidar": ()})  # the wheels alone drive it
    true = true.model_copy(update={"lidars": {}})
    for clockwise in (False, True):
        edge_m = (HALL_M - side_m) / 2
        world = {
            "map_path": hall(out),
            "start_x_m": edge_m,
            "start_y_m": HALL_M - edge_m if clockwise else edge_m,
            "start_heading_rad": 0.0,
        }
        async with simulated_robot(_simulated(settings, true, world, blocking_ultrasonic=False)) as robot:
            telling = asyncio.create_task(_tell_truth(robot))
            errors.append(await _square(robot.client, robot, side_m, clockwise=clockwise))
            telling.cancel()
        say(
            f"a square of {side_m:g} m, {'clockwise' if clockwise else 'counter-clockwise'}: "
            f"{1000 * errors[-1].distance_m:.1f} mm and {math.degrees(errors[-1].heading_rad):.2f} degrees off"
        )
    return tuple(errors)


async def _square(client: Client, robot: SimulatedRobot, side_m: float, *, clockwise: bool) -> SquareError:
    await client.arm()
    await asyncio.sleep(1.0)
    odom_from_start, world_from_start = await _odometry(client), _truth(robot)
    legs = square(side_m)
    await CourseDriver(client, lambda progress: None).drive_course(
        tuple(map(_mirrored, legs)) if clockwise else legs
    )
    driven = odom_from_start.inverse().compose(await _odometry(client))
    true = world_from_start.inverse().compose(_truth(robot))
    return SquareError(
        clockwise,
        math.hypot(driven.x_m - true.x_m, driven.y_m - true.y_m),
        abs(wrap_angle(driven.heading_rad - true.heading_rad)),
    )


async def _tell_truth(robot: SimulatedRobot) -> None:
    """Publish the truth, which the course's own report wants of a simulated robot."""
    while True:
        robot.daemon.bus.publish(robot.board.truth(asyncio.get_running_loop().time()))
        await asyncio.sleep(0.05)


def _slip_rad(true: TrueParameters, side_m: float) -> float:
    """Both sides' variances of travel over the square's length, and that of its four turns."""
    track_m = true.track_width_m or math.inf
    travel_rad2 = 2 * 4 * side_m * true.travel_variance_m2_per_m / track_m**2
    return math.sqrt(travel_rad2 + math.tau * true.turn_variance_rad2_per_rad)


def _mirrored(leg: Leg) -> Leg:
    target = Pose2D(leg.target.x_m, -leg.target.y_m, wrap_angle(-leg.target.heading_rad))
    return type(leg)(target)


async def _odometry(client: Client) -> Pose2D:
    odometry = (await client.get_state()).odometry
    return Pose2D(odometry.x_m, odometry.y_m, odometry.heading_rad)


def _truth(robot: SimulatedRobot) -> Pose2D:
    return robot.board.truth(asyncio.get_running_loop().time()).world_from_base


def hall(out: Path) -> Path:
    """An empty square hall, as a map of 5 cm cells; the path of its YAML file."""
    side = round(HALL_M / 0.05) + 2
    row = bytes([0]) + bytes([254]) * (side - 2) + bytes([0])
    image = bytes([0]) * side + row * (side - 2) + bytes([0]) * side
    (out / "hall.pgm").write_bytes(b"P5 %d %d 255\n" % (side, side) + image)
    text = "image: hall.pgm\nresolution: 0.05\norigin: [-0.05, -0.05, 0]\n"
    text += "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    (out / "hall.yaml").write_text(text)
    return out / "hall.yaml"
