"""Simulated robots on one floor: each sees and touches the others, and stands where it was left."""

import asyncio
import math
from pathlib import Path

import pytest

from chefbotd.clock import LoopClock, run_virtual
from chefbotd.components.simulation.board import BoardRunner
from chefbotd.components.simulation.parameters.simulation import SimulationParameters, WorldParameters
from chefbotd.components.simulation.shared_floor import floor_of, left_where_it_stands
from chefbotd.components.simulation.simulation import Simulation, build_launchpad
from chefbotd.components.simulation.truth_file import TruthReader
from chefbotd.core.geometry import Pose2D


def _simulation(path: Path, start: Pose2D) -> Simulation:
    world = WorldParameters(
        map_path=Path("flat"),
        start_x_m=start.x_m,
        start_y_m=start.y_m,
        start_heading_rad=start.heading_rad,
        shared_truth=path,
    )
    return Simulation(SimulationParameters(world=world))


async def _stand(simulations: list[Simulation], seconds: float) -> list[BoardRunner]:
    """These robots on one floor for so long."""
    clock = LoopClock()
    boards = [BoardRunner(build_launchpad(one), lambda data: None, clock) for one in simulations]
    floors = [floor_of(one) for one in simulations]
    running = [
        asyncio.create_task(floor.run(board, clock))
        for floor, board in zip(floors, boards, strict=True)
        if floor is not None
    ]
    await asyncio.sleep(seconds)
    for task in running:
        task.cancel()
    await asyncio.gather(*running, return_exceptions=True)
    return boards


def test_each_robot_is_a_disc_in_the_others_world(tmp_path: Path) -> None:
    """Where the other stands, as wide as its body; a robot is not in its own way."""
    one = _simulation(tmp_path / "r1.truth", Pose2D(3.0, 4.0, 0.0))
    other = _simulation(tmp_path / "r2.truth", Pose2D(5.0, 4.1, math.pi))
    boards = run_virtual(_stand([one, other], 3.0))
    assert boards[0].crowd.discs.tolist() == [[5.0, 4.1, 0.18]]
    assert boards[1].crowd.discs.tolist() == [[3.0, 4.0, 0.18]]


def test_robots_that_touch_say_so_once(tmp_path: Path) -> None:
    """Two bodies of 0.18 m stand 0.3 m apart: each has begun to touch once, however long it lasts."""
    one = _simulation(tmp_path / "r1.truth", Pose2D(3.0, 4.0, 0.0))
    other = _simulation(tmp_path / "r2.truth", Pose2D(3.3, 4.0, 0.0))
    run_virtual(_stand([one, other], 3.0))
    for name in ("r1", "r2"):
        truth = TruthReader(tmp_path / f"{name}.truth").read()
        assert truth is not None
        assert truth.touches == 1


def test_a_robot_that_is_switched_on_again_stands_where_it_was_left(tmp_path: Path) -> None:
    """Not where its configuration has it start; and the others see it there meanwhile."""
    left = _simulation(tmp_path / "r1.truth", Pose2D(3.0, 4.0, 0.5))
    run_virtual(_stand([left], 1.0))
    again = left_where_it_stands(_simulation(tmp_path / "r1.truth", Pose2D(8.0, 4.0, 0.0)))
    world = again.parameters.world
    assert (world.start_x_m, world.start_y_m, world.start_heading_rad) == (3.0, 4.0, 0.5)
    boards = run_virtual(_stand([_simulation(tmp_path / "r2.truth", Pose2D(5.0, 4.0, 0.0))], 1.5))
    assert boards[0].crowd.discs.tolist() == [[3.0, 4.0, 0.18]]


def test_a_robot_alone_shares_no_floor() -> None:
    """Nothing is written, and it starts as configured."""
    alone = Simulation()
    assert floor_of(alone) is None
    assert left_where_it_stands(alone) is alone


def test_a_file_that_is_only_begun_is_no_robot_yet(tmp_path: Path) -> None:
    """Another robot is just making its file: it is looked at again later."""
    (tmp_path / "r2.truth").write_bytes(b"")
    boards = run_virtual(_stand([_simulation(tmp_path / "r1.truth", Pose2D(3.0, 4.0, 0.0))], 1.5))
    assert not len(boards[0].crowd.discs)


def test_a_file_in_no_folder_is_an_error(tmp_path: Path) -> None:
    """It cannot be made."""
    with pytest.raises(OSError, match="missing"):
        floor_of(_simulation(tmp_path / "missing" / "r1.truth", Pose2D(3.0, 4.0, 0.0)))
