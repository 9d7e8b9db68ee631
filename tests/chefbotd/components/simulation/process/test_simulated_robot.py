"""What is simulated of a configured robot."""

import pytest

from chefbotd.components.simulation.chassis import Wheel
from chefbotd.components.simulation.process.simulated_robot import (
    CannotSimulateError,
    checked_simulation,
    simulation_of,
    true_of,
)
from chefbotd.components.simulation.simulation import build_launchpad
from chefbotd.components.simulation.spinning import LidarMount
from chefbotd.core.geometry import Pose2D
from chefbotd.settings import load, packaged
from chefbotd.settings.loader import read_values
from firmware_protocol.codec import KHAN


def test_khan_is_simulated_with_its_own_wire_wheels_and_sensors() -> None:
    """Four wheels, one infrared sensor on input 0 at its mount, and neither ultrasonic nor IMU."""
    simulated = simulation_of(load(packaged("khan")))
    left, right = Wheel(True, 0.03), Wheel(False, 0.03)
    assert (simulated.variant, simulated.chassis.wheels) == (KHAN, (left, right, left, right))
    (sensor,) = simulated.infrared
    assert (sensor.channel, sensor.base_from_sensor.x_m, sensor.field_of_view_rad) == (0, 0.06, 0.1)
    assert (simulated.ultrasonic, simulated.has_imu) == (None, False)


def test_wheels_are_simulated_as_each_is_configured() -> None:
    """Side, signs, order and effective radius of every wheel: 0.03 * 1.05 and 0.04 on the left, 0.03 * 0.98 right."""
    overrides = {
        "chassis.wheels.0.motor_sign": -1,
        "chassis.wheels.1.side": "left",
        "chassis.wheels.1.radius_m": 0.04,
        "chassis.wheels.2.side": "right",
        "chassis.wheels.2.encoder_sign": -1,
        "chassis.left_radius_multiplier": 1.05,
        "chassis.right_radius_multiplier": 0.98,
    }
    wheels = simulation_of(load(packaged("khan"), overrides=overrides)).chassis.wheels
    assert [wheel.is_left for wheel in wheels] == [True, True, False, False]
    assert [wheel.radius_m for wheel in wheels] == pytest.approx([0.0315, 0.042, 0.0294, 0.0294])
    assert [(wheel.motor_sign, wheel.encoder_sign) for wheel in wheels] == [(-1, 1), (1, 1), (1, -1), (1, 1)]


def test_a_sensor_has_its_mount_from_the_robot_and_its_flaws_from_the_simulation() -> None:
    """ChefBot's ultrasonic sits and looks where it does; how noisy it is, ``[sim]`` says."""
    mount = {"mount_x_m": 0.2, "mount_y_m": -0.1, "mount_heading_rad": 0.3}
    overrides = {f"ultrasonic.{key}": value for key, value in mount.items()}
    simulated = simulation_of(load(overrides={**overrides, "sim.ultrasonic.noise_m": 0.03}))
    assert simulated.ultrasonic is not None
    assert simulated.ultrasonic.base_from_sensor == Pose2D(0.2, -0.1, 0.3)
    assert simulated.parameters.ultrasonic.noise_m == 0.03


def test_turning_is_simulated_with_the_effective_track() -> None:
    """A robot that behaves 1.5 times as wide does so on the simulated floor."""
    simulated = simulation_of(load(packaged("khan"), overrides={"chassis.track_multiplier": 1.5}))
    assert simulated.chassis.track_width_m == 0.189 * 1.5


@pytest.mark.parametrize(
    ("more", "bytes_s"), [({}, 5760.0), ({"sim.board.line_rate_bytes_s": 1000.0}, 1000.0)]
)
def test_the_simulated_line_is_as_fast_as_the_configured_one(more: dict[str, float], bytes_s: float) -> None:
    """8N1: ten bits a byte, so 57,600 baud are 5,760 bytes a second; what ``[sim.board]`` says goes before it.

    The gap between the ends of two lines of the banner is what the second takes.
    """
    launchpad = build_launchpad(simulation_of(load(overrides={"link.baud": 57_600, **more})))
    (first_s, _), (second_s, second) = launchpad.advance(1.0)[:2]
    assert second_s - first_s == pytest.approx(len(second) / bytes_s)


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        ({"sim.world.start_x_m": 2.65, "sim.world.start_y_m": 0.8}, "from a wall"),
        ({"sim.body.wheelbase_m": 0.2}, "wheelbase_m 0.2 needs a side with two wheels"),
        ({"sim.world.map_path": "/no/such/map.yaml"}, "/no/such/map.yaml"),
        ({"sim.world": "/no/such/map.yaml"}, "/no/such/map.yaml"),
        (
            {"sim.world": {"map_path": "flat", "closed_doors": ["cellar"]}},
            "there is no door 'cellar'; there are: living room",
        ),
    ],
)
def test_what_cannot_be_simulated_is_told_in_one_line(overrides: dict[str, object], told: str) -> None:
    """A start in the furniture, a wheelbase without wheels, no map: which robot, and why."""
    with pytest.raises(CannotSimulateError, match=f"^chefbot cannot be simulated: .*{told}") as refused:
        checked_simulation(load(overrides=overrides))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("robot_name", ["chefbot", "chefbot_lidar", "khan"])
def test_the_packaged_robots_can_be_simulated(robot_name: str) -> None:
    """All that come with chefbotd."""
    assert checked_simulation(load(packaged(robot_name))).variant.wheels in (2, 4)


@pytest.mark.parametrize(
    ("world", "start"),
    [
        ("flat", Pose2D(2.5, 2.4, 1.8)),
        ({"map_path": "flat", "start_x_m": 8.3, "start_y_m": 6.2}, Pose2D(8.3, 6.2, 1.8)),
        ("office", Pose2D(1.5, 4.5, 0.1)),
    ],
)
def test_a_building_is_named_and_has_a_start_of_its_own(world: object, start: Pose2D) -> None:
    """``world = "flat"`` is enough; where the robot starts may be said in part."""
    board = build_launchpad(simulation_of(load(overrides={"sim.world": world})))
    assert board.truth(0.0, 0.0).world_from_base == start


def test_the_robot_with_a_lidar_is_chefbot_otherwise() -> None:
    """All that chefbot.toml says is said of it too."""
    plain, seeing = (read_values(packaged(name)) for name in ("chefbot", "chefbot_lidar"))
    assert seeing["robot"].pop("name") == "chefbot_lidar"
    assert plain["robot"].pop("name") == "chefbot"
    assert {key: seeing.get(key) for key in plain} == plain
    assert (seeing["lidar"][0]["model"], seeing["sim"]["world"]) == ("ld19", "flat")


def test_lidars_are_simulated_where_the_real_ones_are() -> None:
    """Mount, name, side up; the height of its own, or what ``[sim.lidar]`` says."""
    lidars = [
        {"name": "low", "model": "ld06", "device": "/dev/a", "mount_x_m": 0.1, "mount_yaw_rad": 3.0},
        {"name": "high", "model": "ld19", "device": "/dev/b", "mount_z_m": 0.4, "upside_down": True},
    ]
    simulated = simulation_of(load(overrides={"lidar": lidars, "sim.lidar.height_m": 0.15})).lidars
    assert simulated == (
        LidarMount("low", Pose2D(0.1, 0.0, 3.0), False, 0.15),
        LidarMount("high", Pose2D(), True, 0.4),
    )


def test_every_lidar_is_simulated_by_its_own_wire() -> None:
    """Slamtec's as themselves, an LD06 as the LD19 whose packets it sends."""
    models = ("ld06", "rplidar_a1", "rplidar_a2")
    lidars = [{"name": model, "model": model, "device": f"/dev/{model}"} for model in models]
    simulated = simulation_of(load(overrides={"lidar": lidars})).lidars
    assert [str(mount.wire) for mount in simulated] == ["ld19", "rplidar_a1", "rplidar_a2"]


def test_the_true_robot_is_apart_from_the_configuration() -> None:
    """A wheel of 46 mm, a track of 0.31 m, a lidar 6 cm ahead and a divider of 4.9, whatever the configuration says."""
    true = {
        "track_width_m": 0.31,
        "wheels": {"left_wheel": {"radius_m": 0.046, "reverse": {"gain": 0.9}, "backlash_rad": 0.01}},
        "lidars": {"lidar": {"mount_x_m": 0.06, "range_offset_m": 0.02}},
        "divider_ratio": 4.9,
    }
    overrides = {"sim.true": true, "chassis.left_radius_multiplier": 1.1, "chassis.track_multiplier": 1.1}
    simulated = simulation_of(load(packaged("chefbot_lidar"), overrides=overrides))
    left, right = simulated.chassis.wheels
    assert (left.radius_m, right.radius_m, simulated.chassis.track_width_m) == (0.046, 0.045, 0.31)
    assert (left.reverse.gain, left.forward.gain, left.backlash_rad) == (0.9, 1.0, 0.01)
    (lidar,) = simulated.lidars
    assert (lidar.base_from_lidar.x_m, lidar.range_offset_m, simulated.divider.ratio) == (0.06, 0.02, 4.9)


def test_a_drawn_robot_is_named_alone_and_known_afterwards() -> None:
    """``true = "imperfect"`` draws a robot; what it is can be asked, and given again as it is."""
    settings = load(packaged("chefbot_lidar"), overrides={"sim.true": "imperfect", "sim.seed": 5})
    drawn = true_of(settings)
    assert drawn.wheels["left_wheel"].radius_m != 0.045
    again = load(packaged("chefbot_lidar"), overrides={"sim.true": drawn.model_dump(mode="json")})
    assert simulation_of(again).chassis == simulation_of(settings).chassis


@pytest.mark.parametrize(
    ("true", "told"),
    [
        ({"wheels": {"left": {}}}, "sim.true.wheels names left, the robot has left_wheel, right_wheel"),
        ({"lidars": {"top": {}}}, "sim.true.lidars names top, the robot has none"),
    ],
)
def test_a_wheel_or_lidar_that_the_robot_has_not_is_refused(true: dict[str, object], told: str) -> None:
    """A name that is mistyped would otherwise change nothing."""
    with pytest.raises(CannotSimulateError, match=told):
        checked_simulation(load(overrides={"sim.true": true}))
