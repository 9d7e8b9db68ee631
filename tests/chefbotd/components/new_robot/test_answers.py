"""Answers in a robot's file: a new one with only what differs, and one that is there already."""

from pathlib import Path

from chefbotd.components.new_robot.answers import FoundValue, differing, edit_answers, new_file
from chefbotd.settings import Settings, load, packaged
from chefbotd.settings.loader import read_values
from tests.robot_files import full

LIDAR = {
    "lidar.lidar.model": FoundValue("ld19", ""),
    "lidar.lidar.device": FoundValue("/dev/ttyUSB3", "its own adapter"),
    "lidar.lidar.mount_x_m": FoundValue(0.05, "ahead of the axle"),
}


def loaded(folder: Path, text: str) -> Settings:
    """The settings of a file with this text."""
    path = folder / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return load(path)


def test_a_lidar_is_an_entry_of_a_list_in_a_new_file_and_in_an_old_one(tmp_path: Path) -> None:
    """Added to a file without one, and changed in a file with one."""
    new = loaded(tmp_path, new_file("chefbot", LIDAR))
    assert [(lidar.name, lidar.device, lidar.mount_x_m) for lidar in new.lidar] == [
        ("lidar", "/dev/ttyUSB3", 0.05)
    ]
    text = edit_answers('extends = "chefbot"\nimu = false\n', LIDAR)
    assert loaded(tmp_path, text).lidar == new.lidar
    moved = edit_answers(text, {"lidar.lidar.mount_x_m": FoundValue(0.07, "")})
    assert [lidar.mount_x_m for lidar in loaded(tmp_path, moved).lidar] == [0.07]


def test_a_sensor_is_left_out_of_an_old_file_and_put_back(tmp_path: Path) -> None:
    """``imu = false`` comes below extends; a key of a section that was left out brings the section back."""
    text = edit_answers(
        '# mine\nextends = "chefbot"  # two wheels\n\n[imu]\nlag_s = 0.1\n', {"imu": FoundValue(False, "")}
    )
    assert text.startswith('# mine\nextends = "chefbot"  # two wheels\nimu = false\n')
    assert loaded(tmp_path, text).imu is None
    without = 'extends = "chefbot"\nultrasonic = false\n'
    back = edit_answers(without, {"ultrasonic.mount_x_m": FoundValue(0.1, "")})
    sensor = loaded(tmp_path, back).ultrasonic
    assert sensor is not None
    assert (sensor.mount_x_m, sensor.max_range_m) == (0.1, 4.0)


def test_comments_of_ours_are_true_after_a_second_run() -> None:
    """What is measured now is not "not measured yet"; a number in a reason is the new one; a user's words stay."""
    radius = "chassis.wheels.left_wheel.radius_m"
    before = {
        radius: FoundValue(0.033, "20.73 cm a turn, by tape"),
        "chassis.track_width_m": FoundValue(0.17, "by tape"),
        "body": FoundValue(False, "not measured: the box about the wheels is the outline"),
    }
    text = new_file("chefbot", before, ["encoders.counts_per_turn", "drive.max_rim_speed_m_s and the gains"])
    text = text.replace("# by tape", "# as Ann says")
    answers = {
        "encoders.counts_per_turn": FoundValue(1440.0, ""),
        radius: FoundValue(0.034, "21.36 cm a turn, by tape"),
        "chassis.track_width_m": FoundValue(0.18, "by tape"),
        "body.length_m": FoundValue(0.2, ""),
    }
    after = edit_answers(text, answers, ["drive.max_rim_speed_m_s and the gains"])
    assert "Not measured yet, and still chefbot's: encoders" not in after
    assert "Not measured yet, and still chefbot's: drive.max_rim_speed_m_s and the gains" in after
    assert "radius_m = 0.034" in after
    assert "# 21.36 cm a turn, by tape" in after
    assert "track_width_m = 0.18" in after
    assert "# as Ann says" in after
    assert "the outline" not in after


def test_a_whole_file_loses_a_section_that_the_robot_lacks(tmp_path: Path) -> None:
    """A copy of ChefBot's whole file extends nothing; its section goes."""
    text = edit_answers(full().read_text(encoding="utf-8"), {"imu": FoundValue(False, "")})
    assert loaded(tmp_path, text).imu is None
    assert "imu = false" not in text


def test_what_the_file_says_already_is_no_difference() -> None:
    """Also a whole number for one with a point, and a section that is not there."""
    values = read_values(packaged())
    same = {
        "encoders.counts_per_turn": FoundValue(4200.0, ""),
        "chassis.wheels.left_wheel.radius_m": FoundValue(0.045, ""),
        "lidar": FoundValue(False, ""),
        "robot.name": FoundValue("chefbot", ""),
    }
    assert differing(same, values) == {}
    assert differing({"imu": FoundValue(False, "")}, values).keys() == {"imu"}
