"""The simulator's configuration as a whole."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pydantic import ValidationError

from chefbotd.components.simulation.chassis import PUBLISHED
from chefbotd.components.simulation.parameters.simulation import SimulationParameters
from chefbotd.components.simulation.simulation import Simulation, build_launchpad
from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import replace
from firmware_protocol.codec import CLASSIC, KHAN, Variant


def test_defaults_are_the_published_robot() -> None:
    """An empty table is the robot of the book: 80 rpm, 255, 4200 counts, 0.09 m wheels, 0.3 m apart."""
    simulation = Simulation()
    motor, chassis = simulation.parameters.motor, simulation.chassis
    assert (motor.no_load_speed_rpm, simulation.parameters.board.pwm_full_scale) == (80, 255)
    assert [2 * wheel.radius_m for wheel in chassis.wheels] == [0.09, 0.09]
    assert (chassis.counts_per_turn, chassis.track_width_m) == (4200, 0.3)


@pytest.mark.parametrize(("variant", "wheels"), [(CLASSIC, 4), (KHAN, 2)])
def test_a_wire_that_is_not_the_robots_is_refused(variant: Variant, wheels: int) -> None:
    """Four wheels on the classic wire, or two on KHAN's: both numbers are named."""
    chassis = replace(PUBLISHED, wheels=PUBLISHED.wheels * (wheels // 2))
    told = f"the wire '{variant.name}' has {variant.wheels} wheels, the robot {wheels}"
    with pytest.raises(ValueError, match=told):
        Simulation(variant=variant, chassis=chassis)


def test_a_wheelbase_that_would_do_nothing_is_refused() -> None:
    """One wheel a side has no wheelbase to be dragged over."""
    with pytest.raises(ValueError, match=r"sim\.body\.wheelbase_m 0\.2 needs a side with two wheels"):
        Simulation(SimulationParameters.model_validate({"body": {"wheelbase_m": 0.2}}))


@pytest.mark.parametrize(
    "key",
    [
        "board.cycles",
        "body.wheel_radius_m",
        "body.track_width_m",
        "body.wheels_per_side",
        "body.counts_per_turn",
        "battery.divider_ratio",
        "battery.adc_reference_v",
        "ultrasonic.mount_x_m",
        "ultrasonic.field_of_view_rad",
        "wire",
        "infrared",
    ],
)
def test_unknown_keys_are_refused(key: str) -> None:
    """A misspelt key, and what the robot's own sections say: nothing is taken that would not be in force."""
    *table, last = key.split(".")
    values = {table[0]: {last: 1}} if table else {last: 1}
    with pytest.raises(ValidationError, match=re.escape(key)):
        SimulationParameters.model_validate(values)


def test_a_map_replaces_the_room(tmp_path: Path) -> None:
    """The robot starts where it is told, between the map's walls."""
    Image.fromarray(np.full((1, 1), 0, dtype=np.uint8)).save(tmp_path / "m.png")
    (tmp_path / "m.yaml").write_text("image: m.png\nresolution: 1.0\norigin: [7, -0.5, 0]\n")
    world = {"map_path": tmp_path / "m.yaml", "start_x_m": 5.0, "start_heading_rad": 0.1}
    launchpad = build_launchpad(Simulation(SimulationParameters.model_validate({"world": world})))
    assert launchpad.truth(0.0, 0.0).world_from_base == Pose2D(5.0, 0.0, 0.1)
    distances = [line for _, line in launchpad.advance(1.0) if line.startswith(b"u")]
    assert (
        180 <= int(distances[0][2:]) <= 186
    )  # 7 - 5 - 0.15 m ahead, less 343 against the sketch's 344.8 m/s


def test_a_start_in_the_furniture_is_refused() -> None:
    """The cupboard stands at (2.7, 0.2) to (3.1, 1.4)."""
    world = {"start_x_m": 2.65, "start_y_m": 0.8}
    with pytest.raises(ValueError, match="from a wall"):
        build_launchpad(Simulation(SimulationParameters.model_validate({"world": world})))
