"""Lidars in the configuration: what is taken, what is refused, and where the robot's description shows them."""

import math
from pathlib import Path

import pytest

from chefbotd.sensing.lidar import LidarModel
from chefbotd.settings import SettingsError, load, packaged
from chefbotd.settings.description import UrdfDescription, differences
from chefbotd.settings.urdf import urdf_of
from tests.robot_files import full

LD19 = {"name": "top", "model": "ld19", "device": "/dev/ttyUSB0"}
A1 = {"name": "low", "model": "rplidar_a1", "device": "/dev/ttyUSB1"}


def test_without_a_table_there_is_no_lidar() -> None:
    """Of both packaged robots, whose files have one commented out."""
    assert load(packaged("chefbot")).lidar == load(packaged("khan")).lidar == ()


def test_what_is_left_out_is_the_model_s_own() -> None:
    """The LD19 from 0.02 to 12 m, the A1 from 0.15 m; a value of one's own goes before."""
    top, low = load(overrides={"lidar": [LD19, {**A1, "max_range_m": 6.5}]}).lidar
    assert (top.model, top.band_m, top.baud) == (LidarModel.LD19, (0.02, 12.0), None)
    assert (low.model, low.band_m) == (LidarModel.RPLIDAR_A1, (0.15, 6.5))
    assert top.model.is_ldrobot
    assert not low.model.is_ldrobot


@pytest.mark.parametrize(
    "path", [packaged("chefbot"), full("chefbot"), full("khan")], ids=["short", "chefbot", "khan"]
)
def test_the_commented_table_of_a_packaged_robot_is_a_good_one(path: Path, tmp_path: Path) -> None:
    """Who takes the comment signs away has a configuration with a lidar."""
    lines = [*path.read_text().splitlines(), ""]
    begin = next(number for number, line in enumerate(lines) if line.startswith("# [[lidar]]"))
    end = lines.index("", begin)
    lines[begin:end] = [line.removeprefix("# ") for line in lines[begin:end]]
    path = tmp_path / "mine.toml"
    path.write_text("\n".join(lines))
    (lidar,) = load(path).lidar
    assert (lidar.name, lidar.model, lidar.mount_x_m) == ("lidar", "ld19", 0.05)


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (
            {"lidar": [{**LD19, "model": "ld20"}]},
            r"lidar.top.model: .*'ld06', 'ld19', 'rplidar_a1' or 'rplidar_a2'",
        ),
        ({"lidar": [{**LD19, "device": "loop://"}]}, r"expected a path such as /dev/ttyUSB0 or socket://"),
        ({"lidar": [{**LD19, "mount_yaw_rad": 180}]}, r"lidar.top.mount_yaw_rad: .*6.28.* .got 180"),
        (
            {"lidar": [{**A1, "max_range_m": 0.15}]},
            r"min_range_m must be below max_range_m, got 0.15 and 0.15",
        ),
        ({"lidar": [{**LD19, "blind_sectors_rad": [[90, 180]]}]}, r"radians, CCW.* got \(90, 180\)"),
        ({"lidar": [{**LD19, "blind_sectors_rad": [[1.5, 1.5]]}]}, r"different values.* got \(1.5, 1.5\)"),
        ({"lidar": [LD19, {**A1, "name": "top"}]}, r"names of their own among the sensors, repeated: top$"),
        ({"lidar": [{**LD19, "name": "front"}]}, r"names of their own among the sensors, repeated: front$"),
        (
            {"lidar": [LD19, {**A1, "device": "/dev/ttyUSB0"}]},
            r"lidar low needs a device of its own, '/dev/ttyUSB0' is that of lidar top$",
        ),
        (
            {"lidar": [{**LD19, "device": "/dev/ttyACM0"}]},
            r"lidar top needs a device of its own, '/dev/ttyACM0' is that of link.device$",
        ),
    ],
)
def test_a_lidar_that_cannot_be_is_refused(overrides: dict[str, object], told: str) -> None:
    """The value is named, and what was expected."""
    with pytest.raises(SettingsError, match=told):
        load(overrides=overrides)


def test_two_names_of_one_device_are_one_device(tmp_path: Path) -> None:
    """Udev's lasting name is a symlink to the one that the board has."""
    port, lasting = tmp_path / "ttyACM7", tmp_path / "usb-board"
    port.touch()
    lasting.symlink_to(port)
    overrides = {"link.device": str(port), "lidar": [{**LD19, "device": str(lasting)}]}
    with pytest.raises(
        SettingsError, match=r"lidar top needs a device of its own, .* is that of link.device"
    ):
        load(overrides=overrides)


def test_a_lidar_is_something_to_guard_with() -> None:
    """A guard without range sensors is refused, but for a lidar whose scans it takes."""
    blind = {"infrared": [], "safety.guard.silent_is_obstacle": True}
    load(packaged("khan"), overrides={**blind, "lidar": [LD19]})
    with pytest.raises(SettingsError, match="no sensor to guard with"):
        load(packaged("khan"), overrides={**blind, "lidar": [{**LD19, "guards": False}]})


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (
            {"safety.guard.scan.turn_deceleration_rad_s2": 2.5},
            r"safety.guard.scan.turn_deceleration_rad_s2 2.5 counts on more braking than limits.angular allows \(2\)",
        ),
        (
            {"limits.linear.reverse_deceleration_m_s2": 0.4},
            r"safety.guard.deceleration_m_s2 0.5 counts on more braking than limits.linear allows \(0.4\)",
        ),
    ],
)
def test_a_guard_by_lidars_counts_on_no_braking_that_is_not_there(
    overrides: dict[str, object], told: str
) -> None:
    """Backwards and in turns too, which no single beam of ChefBot looks at; where no lidar guards it is no matter."""
    with pytest.raises(SettingsError, match=told):
        load(overrides={**overrides, "lidar": [LD19]})
    load(overrides={**overrides, "lidar": [{**LD19, "guards": False}]})


def test_what_the_guard_stops_for_must_not_be_too_near_to_be_seen() -> None:
    """An A1 sees from 0.15 m on. At the rim of ChefBot (0.18 m), less 0.02 m, it would lose what is 0.07 m before it.

    0.02 + 0.05 + 0.02 = 0.09: 0.06 m are missing. With that much more, or farther in, or for a lidar that does not
    guard, it is a good configuration.
    """
    at_the_rim = {**A1, "mount_x_m": 0.16}
    told = r"the lidar 'low' sees nothing nearer than 0.15 m .* stop_distance_m = 0.11 \(it is 0.05\)"
    with pytest.raises(SettingsError, match=told):
        load(overrides={"lidar": [at_the_rim]})
    load(overrides={"lidar": [at_the_rim], "safety.guard.scan.stop_distance_m": 0.11})
    load(overrides={"lidar": [{**A1, "mount_x_m": 0.1}]})
    load(overrides={"lidar": [{**at_the_rim, "guards": False}]})
    outside = {**LD19, "mount_y_m": 0.4}
    with pytest.raises(SettingsError, match=r"mounted -0.22 m within"):
        load(overrides={"lidar": [outside]})


MOUNTED = {**LD19, "mount_x_m": 0.11, "mount_y_m": -0.07, "mount_z_m": 0.21, "mount_yaw_rad": 0.7}


@pytest.mark.parametrize("upside_down", [False, True])
def test_the_description_shows_a_lidar_where_it_is_mounted(tmp_path: Path, upside_down: bool) -> None:
    """Its x axis points where the zero mark does, whichever side is up; upside down its z axis points to the floor."""
    settings = load(overrides={"lidar": [{**MOUNTED, "upside_down": upside_down}]})
    path = tmp_path / "made.urdf"
    path.write_text(urdf_of(settings))
    made = UrdfDescription(path)
    assert differences(made, settings) == []
    assert made.place("lidar_joint") == pytest.approx((0.11, -0.07, 0.21))
    assert made.mount("lidar_joint").heading_rad == pytest.approx(0.7)
    roll = math.pi if upside_down else 0
    assert f'rpy="{roll:.9g} 0 0.7"' in path.read_text()


def test_of_several_lidars_each_has_a_joint_by_its_name(tmp_path: Path) -> None:
    """A description of one's own with another yaw is told by the lidar's own key."""
    settings = load(overrides={"lidar": [MOUNTED, A1]})
    path = tmp_path / "made.urdf"
    path.write_text(urdf_of(settings).replace('rpy="0 0 0.7"', 'rpy="0 0 0.9"'))
    assert "lidar_low_joint" in UrdfDescription(path).joints()
    assert differences(UrdfDescription(path), settings) == [
        "lidar_top_joint: the yaw is 0.9 rad, expected 0.7 rad (lidar.top.mount_yaw_rad)"
    ]


def test_the_map_is_made_of_a_lidar_that_there_is() -> None:
    """[mapping] lidars names some of those that are configured, each once; the refusal lists them."""
    row = {"name": "top", "model": "ld19", "device": "/dev/ttyUSB0", "guards": False}
    assert load(overrides={"lidar": [row], "mapping.lidars": ["top"]}).mapping.lidars == ("top",)
    with pytest.raises(SettingsError, match=r"mapping\.lidars: 'low' is no lidar \(those configured: top\)"):
        load(overrides={"lidar": [row], "mapping.lidars": ["top", "low"]})
    with pytest.raises(SettingsError, match=r"localization\.lidars names each lidar once, repeated: 'top'"):
        load(overrides={"lidar": [row], "localization.lidars": ["top", "top"]})
    with pytest.raises(SettingsError, match=r"none is configured"):
        load(overrides={"mapping.lidars": ["low"]})
