"""What is simulated of a configured robot."""

from chefbotd.settings import load, packaged
from chefbotd.sim.sensors import UltrasonicParameters
from chefbotd.simulation import simulation_of


def test_khan_is_simulated_with_its_own_wire_wheels_and_sensors() -> None:
    """Four wheels, one infrared sensor on input 0 at its mount, and neither ultrasonic nor IMU."""
    simulated = simulation_of(load(packaged("khan")))
    assert (simulated.wire, simulated.body.wheel_count, simulated.body.wheelbase_m) == ("khan", 4, 0.185)
    (sensor,) = simulated.infrared
    assert (sensor.channel, sensor.mount_x_m, sensor.field_of_view_rad) == (0, 0.06, 0.1)
    assert (simulated.ultrasonic, simulated.imu) == (None, None)


def test_a_sensor_has_its_mount_from_the_robot_and_its_flaws_from_the_simulation() -> None:
    """ChefBot's ultrasonic sits where it sits; how noisy it is, ``[sim]`` says."""
    overrides = {"ultrasonic.mount_x_m": 0.2, "sim.ultrasonic.noise_m": 0.03}
    ultrasonic = simulation_of(load(overrides=overrides)).ultrasonic
    assert isinstance(ultrasonic, UltrasonicParameters)
    assert (ultrasonic.mount_x_m, ultrasonic.noise_m) == (0.2, 0.03)


def test_turning_is_simulated_with_the_effective_track() -> None:
    """A robot that behaves 1.5 times as wide does so on the simulated floor."""
    simulated = simulation_of(load(packaged("khan"), overrides={"chassis.track_multiplier": 1.5}))
    assert simulated.body.track_width_m == 0.189 * 1.5


def test_the_simulated_line_is_as_fast_as_the_configured_one() -> None:
    """8N1: ten bits a byte, so 57,600 baud are 5,760 bytes a second; what ``[sim.board]`` says goes before it."""
    assert simulation_of(load(overrides={"link.baud": 57_600})).board.line_rate_bytes_s == 5760.0
    slower = load(overrides={"link.baud": 57_600, "sim.board.line_rate_bytes_s": 1000.0})
    assert simulation_of(slower).board.line_rate_bytes_s == 1000.0
