"""The wire of each published sketch, from the opening over a drive and a reset to the next drive."""

import asyncio
import math

import pytest

from chefbotd.clock import run_virtual
from chefbotd.components.simulation.parameters.sketches import PUBLISHED_SKETCHES, SketchName
from chefbotd.core import events
from chefbotd.settings import Settings, load
from chefbotd.testing.daemon import SimulatedRobot, simulated_robot
from tests.budget import sample


def settings_of(sketch: SketchName) -> Settings:
    """The packaged ChefBot with the board of this sketch."""
    return load(overrides={"sim.board.sketch": str(sketch)})


async def drive(robot: SimulatedRobot, linear_m_s: float, angular_rad_s: float, seconds: float) -> None:
    """Repeat a velocity at 20 Hz."""
    for _ in range(round(seconds / 0.05)):
        await robot.client.drive(linear_m_s, angular_rad_s)
        await asyncio.sleep(0.05)


async def odometry_error_m(robot: SimulatedRobot) -> float:
    """How far odometry is from the truth, as the robot drives or stands."""
    pose = (await robot.client.get_state()).topics["odometry"].data
    true = robot.board.truth(0.0).world_from_base
    return math.dist((pose.x_m, pose.y_m), (true.x_m, true.y_m))


LOST_M = 0.002
"""Rolled out within the second in which the sketch waits for its reset, 9 mm were lost."""


@pytest.mark.parametrize("sketch", sample(PUBLISHED_SKETCHES))
def test_an_ordinary_drive_is_read_without_a_complaint(sketch: SketchName):
    """A curve at 0.2 m/s: no jump, no malformed line, no byte lost at the board, no stuck echo, and it stays armed."""

    async def run() -> None:
        async with simulated_robot(settings_of(sketch)) as robot:
            judged = robot.daemon.bus.subscribe(events.LinkHealthChanged)
            await asyncio.sleep(2.0)
            await drive(robot, 0.2, 0.5, 4.0)
            state, stats = await robot.client.get_state(), await robot.client.get_stats()
            assert state.safety.mode == "armed"
            assert stats.encoder_readings_refused == 0
            assert stats.refused == {}
            assert {judged.take_event().condition for _ in range(len(judged))} == {"healthy"}

    run_virtual(run())


@pytest.mark.parametrize("sketch", sample(PUBLISHED_SKETCHES))
def test_a_reset_while_driving_stops_first_and_tells_its_end(sketch: SketchName):
    """The robot stands when ``r`` comes, no way is lost by that, and it drives again; the Arduino's goes on."""

    async def run() -> None:
        async with simulated_robot(settings_of(sketch)) as robot:
            progress = robot.daemon.bus.subscribe(events.BoardResetProgressed)
            await asyncio.sleep(2.0)
            await drive(robot, 0.2, 0.3, 2.0)
            duties: list[tuple[int, ...]] = []
            off_m = await odometry_error_m(robot)
            receive = robot.device.on_write

            def watched(data: bytes) -> None:
                if b"r" in data:
                    duties.append(robot.board.duty)
                receive(data)

            robot.device.on_write = watched
            restarts = sketch is not SketchName.DUEMILANOVE
            await robot.client.reset_board()
            await asyncio.sleep(4.5)
            stages = [progress.take_event().stage for _ in range(len(progress))]
            assert stages == ["stopping", "asked", "restarted" if restarts else "not_restarted"]
            assert duties == [(0, 0)]
            assert await odometry_error_m(robot) - off_m < LOST_M
            assert (await robot.client.get_state()).safety.armed is not restarts
            await robot.client.arm()
            await drive(robot, 0.2, 0.3, 1.0)
            assert robot.board.truth(0.0).twist.linear_m_s == pytest.approx(0.2, abs=0.05)

    run_virtual(run())


@pytest.mark.parametrize("sketch", sample([SketchName.DUEMILANOVE, SketchName.TIVA]))
def test_no_byte_overflows_the_buffer_of_a_board_that_waits_for_echoes(sketch: SketchName):
    """One echo in ten is missing, and the loop waits 0.2 s for it; 100 changing commands a second meanwhile.

    Nothing is lost at the board, so no piece of a command can be obeyed; with its 63 bytes uncounted, 2,781 were.
    """

    async def run() -> None:
        overrides = {
            "sim.board.sketch": str(sketch),
            "sim.board.echo_timeout_s": 0.2,
            "sim.ultrasonic.lost_echo_share": 0.1,
        }
        async with simulated_robot(load(overrides=overrides)) as robot:
            for number in range(500):
                await robot.client.drive(0.1 + 0.0001 * (number * 37 % 1000), 0.3 - 0.001 * (number % 7))
                await asyncio.sleep(0.01)
            assert robot.daemon.session.writer.memory.lines_out > 300
            assert robot.board.received_dropped == 0

    run_virtual(run())
