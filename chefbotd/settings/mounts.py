"""The joints of the robot that its configuration has: its wheels, and its sensors with their mounts."""

from chefbotd.core.geometry import Pose2D
from chefbotd.core.record import Record
from chefbotd.settings.model import Settings


class Mount(Record, frozen=True):
    """A sensor of the configuration's ``section``, and its height above the floor.

    ``placed`` is False where only its heading is configured, by the key ``heading_key``. What is mounted
    ``upside_down`` is rolled half a turn about its x axis.
    """

    joint: str
    section: str
    base_from_sensor: Pose2D
    height_m: float | None
    placed: bool = True
    heading_key: str = "mount_heading_rad"
    upside_down: bool = False


def mounts(settings: Settings) -> list[Mount]:
    """The sensors with a configured mount.

    Their joints are ``ultrasonic_joint``, ``imu_joint``, ``infrared_joint`` and ``lidar_joint``, or, of several infrared
    sensors or lidars, ``infrared_NAME_joint`` and ``lidar_NAME_joint``.
    """
    mounts_found = []
    if (sonar := settings.ultrasonic) is not None:
        mounts_found.append(Mount("ultrasonic_joint", "ultrasonic", sonar.base_from_sensor, sonar.mount_z_m))
    several = len(settings.infrared) > 1
    for sensor in settings.infrared:
        joint = f"infrared_{sensor.name}_joint" if several else "infrared_joint"
        section = f"infrared.{sensor.name}"
        mounts_found.append(Mount(joint, section, sensor.base_from_sensor, sensor.mount_z_m))
    for lidar in settings.lidar:
        joint = f"lidar_{lidar.name}_joint" if len(settings.lidar) > 1 else "lidar_joint"
        section, place = f"lidar.{lidar.name}", lidar.base_from_lidar
        key, rolled = "mount_yaw_rad", lidar.upside_down
        mounts_found.append(
            Mount(joint, section, place, lidar.mount_z_m, heading_key=key, upside_down=rolled)
        )
    if (imu := settings.imu) is not None:
        heading = Pose2D(heading_rad=imu.mount_heading_rad)
        mounts_found.append(Mount("imu_joint", "imu", heading, imu.mount_z_m, placed=False))
    return mounts_found


def joint_names(settings: Settings) -> list[str]:
    """Every joint of the URDF, in its order."""
    wheels = [wheel.name for wheel in settings.chassis.wheels]
    return ["base_joint", *wheels, *(mount.joint for mount in mounts(settings))]
