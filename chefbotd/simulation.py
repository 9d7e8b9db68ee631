"""The simulated robot that a configuration describes."""

from chefbotd.link.line_load import BITS_A_BYTE
from chefbotd.sensing.infrared import InfraredParameters
from chefbotd.sensing.ultrasonic import UltrasonicParameters
from chefbotd.settings import Settings
from chefbotd.sim import infrared, sensors
from chefbotd.sim.parameters import SimulationParameters


def simulation_of(settings: Settings) -> SimulationParameters:
    """What to simulate for this robot: its own wire, line, chassis, divider and sensors, the rest from ``[sim]``."""
    chassis, sim, board = settings.chassis, settings.sim, settings.sim.board
    if "line_rate_bytes_s" not in board.model_fields_set:
        board = board.model_copy(update={"line_rate_bytes_s": settings.link.baud / BITS_A_BYTE})
    divider = {
        "adc_reference_v": settings.battery.reference_v,
        "divider_ratio": settings.battery.divider_ratio,
    }
    parts = {
        "wire": settings.robot.wire,
        "board": board,
        "battery": sim.battery.model_copy(update=divider),
        "ultrasonic": settings.ultrasonic and _ultrasonic(settings.ultrasonic, sim.ultrasonic),
        "infrared": tuple(map(_infrared, settings.infrared)),
        "imu": settings.imu and sim.imu,
    }
    return sim.model_copy(update=parts).with_chassis(
        wheel_radius_m=chassis.wheels[0].radius_m,
        track_width_m=chassis.effective_track_m,
        counts_per_turn=settings.encoders.counts_per_turn,
        wheels_per_side=len(chassis.wheels) // 2,
    )


def _ultrasonic(
    real: UltrasonicParameters, simulated: sensors.UltrasonicParameters | None
) -> sensors.UltrasonicParameters:
    mount = {"mount_x_m": real.mount_x_m, "field_of_view_rad": real.field_of_view_rad}
    return (simulated or sensors.UltrasonicParameters()).model_copy(update=mount)


def _infrared(real: InfraredParameters) -> infrared.InfraredParameters:
    """A sensor where the real one is; its noise and its rays are the simulator's own."""
    shared = real.model_dump(include=set(infrared.InfraredParameters.model_fields))
    return infrared.InfraredParameters.model_validate(shared)
