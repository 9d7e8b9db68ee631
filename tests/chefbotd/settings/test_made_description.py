"""The description that is made of the configuration: it is the one written by hand, and what the daemon serves."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

from chefbotd.settings import SettingsError, load, packaged
from chefbotd.settings.description import UrdfDescription, differences
from chefbotd.settings.urdf import urdf_of
from tests.chefbotd.settings.urdf_files import served, written


@pytest.mark.parametrize("robot", ["chefbot", "khan"])
def test_the_description_that_is_made_is_the_one_written_by_hand(robot: str, tmp_path: Path) -> None:
    """Every joint is where the other has it, masses are equal, and moments of inertia, which it rounds, within 0.5 %."""
    path = tmp_path / "made.urdf"
    path.write_text(urdf_of(load(packaged(robot))))
    made, hand = UrdfDescription(path), UrdfDescription(written(robot))
    assert made.joints() == hand.joints()
    for name in hand.joints():
        assert made.place(name) == pytest.approx(hand.place(name), abs=1e-9), name
    assert [made.radius_m(name) for name in hand.wheel_names()] == [
        hand.radius_m(name) for name in hand.wheel_names()
    ]
    assert made.inertias().keys() == hand.inertias().keys()
    for link, (mass_kg, inertia_kg_m2) in hand.inertias().items():
        assert made.inertias()[link][0] == mass_kg
        assert made.inertias()[link][1] == pytest.approx(inertia_kg_m2, rel=0.005)


OBLIQUE = {
    "chassis.track_width_m": 0.3,
    "chassis.wheels.0.radius_m": 0.04,
    "infrared.0.mount_x_m": 0.11,
    "infrared.0.mount_y_m": -0.07,
    "infrared.0.mount_z_m": 0.2,
    "infrared.0.mount_heading_rad": 0.7,
    "sim.body.wheelbase_m": 0.25,
}


def test_the_description_that_is_made_follows_the_configuration(tmp_path: Path) -> None:
    """A track of 0.3, one larger wheel, a sensor at an odd angle, a wheelbase of 0.25: by hand, seen from the floor.

    The axle is 0.04 m high, so that the smaller wheels (0.03 m) sit 0.01 m lower and touch the floor as well.
    """
    settings = load(packaged("khan"), overrides=OBLIQUE)
    path = tmp_path / "made.urdf"
    path.write_text(urdf_of(settings))
    made = UrdfDescription(path)
    assert differences(made, settings) == []
    assert made.place("front_left_wheel") == pytest.approx((0.125, 0.15, 0.04))
    assert made.place("rear_right_wheel") == pytest.approx((-0.125, -0.15, 0.03))
    assert made.place("infrared_joint") == pytest.approx((0.11, -0.07, 0.2))
    assert made.mount("infrared_joint").heading_rad == pytest.approx(0.7)


def test_what_is_not_known_is_not_described() -> None:
    """Without [body] no link has a mass, and the body no shape; a name is escaped as XML wants it."""
    settings = load(overrides={"robot.name": "<Ann's & Bob's>"}).model_copy(update={"body": None})
    robot = ElementTree.fromstring(urdf_of(settings))
    assert robot.get("name") == "<Ann's & Bob's>"
    assert robot.findall(".//mass") == []
    assert robot.findall("link[@name='base_link']/visual") == []
    assert len(robot.findall(".//visual")) == 2


def test_a_wheel_named_like_a_joint_of_the_description() -> None:
    """Two joints of one name are no URDF: the configuration is refused."""
    with pytest.raises(SettingsError, match=r"joints of their own .* repeated: imu_joint"):
        load(overrides={"chassis.wheels.0.name": "imu_joint"})


def test_the_daemon_serves_the_description_that_is_made() -> None:
    """With the radius that is configured."""
    settings = load(overrides={"chassis.wheels.0.radius_m": 0.047})
    assert served(settings) == urdf_of(settings)
    assert 'cylinder radius="0.047"' in urdf_of(settings)
