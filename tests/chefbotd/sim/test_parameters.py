"""The simulator's configuration as a whole."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pydantic import ValidationError

from chefbotd.core.geometry import Pose2D
from chefbotd.sim.parameters import SimulationParameters, build_launchpad


def test_defaults_are_the_published_robot() -> None:
    """An empty table is the robot of the book: 80 rpm, 1023, 4200 counts, 0.09 m wheels, 0.3 m apart."""
    parameters = SimulationParameters.model_validate({})
    assert (parameters.motor.no_load_speed_rpm, parameters.motor.full_scale_duty) == (80, 1023)
    body = parameters.body
    assert (body.counts_per_turn, 2 * body.wheel_radius_m, body.track_width_m) == (4200, 0.09, 0.3)


def test_the_chassis_of_the_robot_goes_in_by_one_call() -> None:
    """``with_chassis`` replaces these four numbers and keeps everything else."""
    parameters = SimulationParameters.model_validate({"seed": 9, "body": {"mass_kg": 3}})
    khan = parameters.with_chassis(
        wheel_radius_m=0.03, track_width_m=0.189, counts_per_turn=1000, wheels_per_side=2
    )
    body = khan.body
    assert (body.wheel_radius_m, body.track_width_m, body.counts_per_turn) == (0.03, 0.189, 1000)
    assert (body.wheel_count, body.mass_kg, khan.seed) == (4, 3, 9)


def test_a_chassis_out_of_range_is_refused() -> None:
    """A wheel without a radius is named and refused."""
    with pytest.raises(ValidationError, match="wheel_radius_m"):
        SimulationParameters().with_chassis(wheel_radius_m=0, track_width_m=0.3, counts_per_turn=4200)


@pytest.mark.parametrize(("wire", "wheels_per_side"), [("classic", 2), ("khan", 1), ("sled", 1)])
def test_a_wire_that_is_not_the_robots_is_refused(wire: str, wheels_per_side: int) -> None:
    """Four wheels on the classic wire, two on KHAN's, or no such wire: told with those that there are."""
    parameters = SimulationParameters.model_validate(
        {"wire": wire, "body": {"wheels_per_side": wheels_per_side}}
    )
    with pytest.raises(ValueError, match=rf"no wire '{wire}' for a robot with .*khan \(4 wheels\)"):
        build_launchpad(parameters)


def test_unknown_keys_are_refused() -> None:
    """A misspelt key in a nested table is named."""
    with pytest.raises(ValidationError, match=r"board\.cycles"):
        SimulationParameters.model_validate({"board": {"cycles": 1}})


def test_a_map_replaces_the_room(tmp_path: Path) -> None:
    """The robot starts where it is told, between the map's walls."""
    Image.fromarray(np.full((1, 1), 0, dtype=np.uint8)).save(tmp_path / "m.png")
    (tmp_path / "m.yaml").write_text("image: m.png\nresolution: 1.0\norigin: [7, -0.5, 0]\n")
    world = {"map_path": tmp_path / "m.yaml", "start_x_m": 5.0, "start_heading_rad": 0.1}
    launchpad = build_launchpad(SimulationParameters.model_validate({"world": world}))
    assert launchpad.truth(0.0, 0.0).world_from_base == Pose2D(5.0, 0.0, 0.1)
    distances = [line for _, line in launchpad.advance(1.0) if line.startswith(b"u")]
    assert (
        180 <= int(distances[0][2:]) <= 186
    )  # 7 - 5 - 0.15 m ahead, less 343 against the sketch's 344.8 m/s


def test_a_start_in_the_furniture_is_refused() -> None:
    """The cupboard stands at (2.7, 0.2) to (3.1, 1.4)."""
    world = {"start_x_m": 2.65, "start_y_m": 0.8}
    with pytest.raises(ValueError, match="from a wall"):
        build_launchpad(SimulationParameters.model_validate({"world": world}))
