"""Descriptions against configurations."""

from pathlib import Path

import pytest

from chefbotd.settings import load, packaged
from chefbotd.settings.description import DescriptionError, UrdfDescription, differences
from tests.chefbotd.settings.urdf_files import written

KHAN = load(packaged("khan"))


@pytest.fixture
def spoilt(tmp_path: Path) -> Path:
    """A copy of KHAN's description to spoil."""
    copy = tmp_path / "khan.urdf"
    copy.write_text(written("khan").read_text())
    return copy


def spoil(path: Path, old: str, new: str) -> UrdfDescription:
    """Replace text, which must be there, once; the description as it then is."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return UrdfDescription(path)


def joint(name: str, parent: str, child: str, more: str = "") -> str:
    """A continuous joint."""
    links = f"<parent link='{parent}'/><child link='{child}'/>"
    return f"<joint name='{name}' type='continuous'>{links}{more}</joint>"


def tree(*parts: str) -> str:
    """A robot of the links a, b and c; where they are not joined, c is not there."""
    links = "".join(f"<link name='{name}'/>" for name in "abc" if name != "c" or "'c'" in "".join(parts))
    return f"<robot name='r'>{links}{''.join(parts)}</robot>"


@pytest.mark.parametrize("robot", ["chefbot", "khan"])
def test_the_packaged_robots_are_what_they_are_described_as(robot: str) -> None:
    """Wheels and sensors of both URDFs that were written by hand are those of both configurations."""
    assert differences(UrdfDescription(written(robot)), load(packaged(robot))) == []


def test_khan_has_its_published_numbers() -> None:
    """Radius 0.03 m, and 0.189 / 2 = 0.0945 m left and right of the middle."""
    khan = UrdfDescription(written("khan"))
    assert [khan.mount(name).y_m for name in khan.wheel_names()] == [0.0945, -0.0945, 0.0945, -0.0945]
    assert {khan.radius_m(name) for name in khan.wheel_names()} == {0.03}


CYLINDER = '<collision>\n      <origin rpy="1.570796 0 0"/>\n      <geometry><cylinder radius="0.03" length="0.025"/>'
TRACK = "of chassis.track_width_m, to the"
ROUND = "forward is positive"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            'name="rear_left_wheel" type',
            'name="hind_left_wheel" type',
            [
                "rear_left_wheel: there is no such joint, expected a continuous one, the wheel's",
                "hind_left_wheel: a continuous joint, expected none: chassis.wheels has no wheel of that name",
            ],
        ),
        (
            'name="front_left_wheel" type="continuous"',
            'name="front_left_wheel" type="fixed"',
            ["front_left_wheel: the joint is fixed, expected a continuous one, the wheel's"],
        ),
        (
            'name="infrared_joint" type="fixed"',
            'name="infrared_joint" type="continuous"',
            ["infrared_joint: a continuous joint, expected none: chassis.wheels has no wheel of that name"],
        ),
        (
            CYLINDER,
            CYLINDER.replace("0.03", "0.032"),
            ["front_left_wheel: the radius is 0.032 m, expected 0.03 m (its radius_m)"],
        ),
        (
            CYLINDER,
            CYLINDER.replace('cylinder radius="0.03" length="0.025"', 'sphere radius="0.03"'),
            ["front_left_wheel: its link has no cylinder, expected one with a radius of 0.03 m"],
        ),
        (
            '"0.0925 0.0945 0"',
            '"0.0925 0.1145 0"',
            [f"front_left_wheel: y is 0.1145 m, expected 0.0945 m (half {TRACK} left)"],
        ),
        (
            '"-0.0925 -0.0945 0"',
            '"-0.0925 nan 0"',
            [f"rear_right_wheel: y is nan m, expected -0.0945 m (half {TRACK} right)"],
        ),
        (
            '<axis xyz="0 1 0"/>',
            '<axis xyz="0 -1 0"/>',
            [f"front_left_wheel: the axis is (0, -1, 0), expected (0, 1, 0): {ROUND}"],
        ),
        (
            '<axis xyz="0 1 0"/>',
            "",
            [f"front_left_wheel: the axis is (1, 0, 0), expected (0, 1, 0): {ROUND}"],
        ),
        ('<axis xyz="0 1 0"/>', '<axis xyz="0 2 0"/>', []),
        (
            '"-0.0925 0.0945 0"',
            '"-0.0925 0.0945 0" rpy="3.14159265 0 0"',
            [f"rear_left_wheel: the axis is (0, -1, 0), expected (0, 1, 0): {ROUND}"],
        ),
        (
            '"0.06 0 0.05"',
            '"0.07 0 0.05"',
            ["infrared_joint: x is 0.07 m, expected 0.06 m (infrared.front.mount_x_m)"],
        ),
        (
            '"0.06 0 0.05"',
            '"0.06 -0.02 0.05"',
            ["infrared_joint: y is -0.02 m, expected 0 m (infrared.front.mount_y_m)"],
        ),
        (
            '"0.06 0 0.05"',
            '"0.06 0 0.05" rpy="0 0 1.5708"',
            ["infrared_joint: the yaw is 1.571 rad, expected 0 rad (infrared.front.mount_heading_rad)"],
        ),
        ('"0.06 0 0.05"', '"0.06 0 0.05" rpy="0 0.3 0"', []),
        (
            'name="infrared_joint"',
            'name="eye_joint"',
            ["infrared_joint: there is no such joint, expected one for [infrared.front]"],
        ),
    ],
)
def test_each_difference_is_a_line_of_its_own(spoilt: Path, old: str, new: str, told: list[str]) -> None:
    """It names the joint, the value found and the one expected; an axis has no length, a beam may be tilted."""
    assert differences(spoil(spoilt, old, new), KHAN) == told


def test_two_wheels_that_are_wrong_alike_are_told_both(spoilt: Path) -> None:
    """Left and right both moved 0.02 m to the left: the sides are as far apart as ever, and each wheel is wrong."""
    spoil(spoilt, '"0.0925 0.0945 0"', '"0.0925 0.1145 0"')
    moved = spoil(spoilt, '"0.0925 -0.0945 0"', '"0.0925 -0.0745 0"')
    assert differences(moved, KHAN) == [
        f"front_left_wheel: y is 0.1145 m, expected 0.0945 m (half {TRACK} left)",
        f"front_right_wheel: y is -0.0745 m, expected -0.0945 m (half {TRACK} right)",
    ]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            '"0.15 0 0.1"',
            '"0.1 0 0.1"',
            ["ultrasonic_joint: x is 0.1 m, expected 0.15 m (ultrasonic.mount_x_m)"],
        ),
        (
            '<child link="imu_link"/>\n    <origin xyz="0 0 0.1"/>',
            '<child link="imu_link"/>\n    <origin xyz="0.05 0.01 0.1" rpy="0 0 -1.5708"/>',
            ["imu_joint: the yaw is -1.571 rad, expected 0 rad (imu.mount_heading_rad)"],
        ),
        ('"0 0.15 0"', '"0 -0.15 0"', [f"left_wheel: y is -0.15 m, expected 0.15 m (half {TRACK} left)"]),
    ],
)
def test_chefbots_sensors_and_wheels_are_compared_too(
    tmp_path: Path, old: str, new: str, told: list[str]
) -> None:
    """The ultrasonic's place; the IMU's heading, which is all that is configured of it; a wheel on the other side."""
    copy = tmp_path / "chefbot.urdf"
    copy.write_text(written("chefbot").read_text())
    assert differences(spoil(copy, old, new), load()) == told


def test_a_turned_imu_is_described_as_it_is_configured(tmp_path: Path) -> None:
    """Half a turn is the same from both sides: pi in the one, -pi in the other."""
    copy = tmp_path / "chefbot.urdf"
    copy.write_text(written("chefbot").read_text())
    link = '<child link="imu_link"/>\n    <origin xyz="0 0 0.1"'
    turned = spoil(copy, link, f'{link} rpy="0 0 3.1415926"')
    assert differences(turned, load(overrides={"imu.mount_heading_rad": -3.1415926})) == []


PUBLISHED = """<robot name="chefbot"><link name="base_link"/>
  <joint name="left_wheel" type="continuous">
    <parent link="base_link"/><child link="left_link"/>
    <origin xyz="0 0.14 0.026" rpy="-1.5707963 0 0"/><axis xyz="0 0 1"/>
  </joint>
  <link name="left_link"><collision><geometry><cylinder length="0.0206" radius="0.0352"/></geometry></collision></link>
  <joint name="right_wheel" type="continuous">
    <parent link="base_link"/><child link="right_link"/>
    <origin xyz="0 -0.14 0.026" rpy="-1.5707963 0 0"/><axis xyz="0 0 1"/>
  </joint>
  <link name="right_link"><collision><geometry><cylinder length="0.0206" radius="0.0350"/></geometry></collision></link>
</robot>"""
"""The wheels of chefbot_description/urdf/chefbot_base.urdf.xacro (ROM-robotics/chefbot), by our names."""

WITHOUT_SENSORS = {"ultrasonic": None, "imu": None}


def test_the_published_description_is_not_of_the_robot_that_its_host_drives(tmp_path: Path) -> None:
    """Its host has a base_width of 0.3 m and 14865 ticks a metre, which are wheels of 0.045 m; it has neither."""
    path = tmp_path / "chefbot.urdf"
    path.write_text(PUBLISHED)
    assert differences(UrdfDescription(path), load(overrides=WITHOUT_SENSORS)) == [
        "left_wheel: the radius is 0.0352 m, expected 0.045 m (its radius_m)",
        f"left_wheel: y is 0.14 m, expected 0.15 m (half {TRACK} left)",
        "right_wheel: the radius is 0.035 m, expected 0.045 m (its radius_m)",
        f"right_wheel: y is -0.14 m, expected -0.15 m (half {TRACK} right)",
    ]


def test_two_wheels_of_one_radius_are_described_by_one_number(tmp_path: Path) -> None:
    """The published ones differ by 0.2 mm, less than a ruler shows; where both are configured so, nothing is told."""
    path = tmp_path / "chefbot.urdf"
    path.write_text(PUBLISHED)
    base = {**WITHOUT_SENSORS, "chassis.track_width_m": 0.28}

    def told(left_m: float, right_m: float) -> list[str]:
        wheels = [
            {"name": "left_wheel", "side": "left", "radius_m": left_m},
            {"name": "right_wheel", "side": "right", "radius_m": right_m},
        ]
        return differences(UrdfDescription(path), load(overrides={**base, "chassis.wheels": wheels}))

    assert told(0.035, 0.035) == [
        "right_wheel: the radius is 0.035 m, expected 0.0352 m as left_wheel's: they are equal"
    ]
    assert told(0.0352, 0.035) == []


def test_what_calibration_finds_changes_no_description() -> None:
    """A robot that turns as if it were wider, on wheels that roll farther, is built as it was."""
    found = {
        "chassis.track_multiplier": 1.5,
        "chassis.left_radius_multiplier": 1.01,
        "chassis.right_radius_multiplier": 0.99,
    }
    assert differences(UrdfDescription(written("khan")), load(packaged("khan"), overrides=found)) == []


def test_of_several_infrared_sensors_each_has_a_joint_by_its_name(spoilt: Path) -> None:
    """``infrared_NAME_joint``; the one that is not there is told."""
    front = KHAN.infrared[0]
    rear = front.model_copy(update={"name": "rear", "channel": 1, "mount_x_m": -0.06})
    both = KHAN.model_copy(update={"infrared": (front, rear)})
    described = spoil(spoilt, 'name="infrared_joint"', 'name="infrared_front_joint"')
    assert differences(described, both) == [
        "infrared_rear_joint: there is no such joint, expected one for [infrared.rear]"
    ]


def test_a_wheel_stands_where_its_joints_say_together(spoilt: Path) -> None:
    """With the base turned a quarter to the left, what was 0.0925 m ahead is 0.0925 m left."""
    turned = spoil(
        spoilt, '<origin xyz="0 0 0.03"/>', '<origin xyz="0 0 0.03" rpy="0 0 1.5707963267948966"/>'
    )
    assert turned.mount("front_left_wheel").y_m == pytest.approx(0.0925)
    assert turned.mount("rear_right_wheel").y_m == pytest.approx(-0.0925)
    assert turned.axis("front_left_wheel") == pytest.approx((-1.0, 0.0, 0.0))


def test_a_joint_may_leave_its_origin_out(spoilt: Path) -> None:
    """It is then at its parent's, and a link without a body has no radius."""
    text = spoilt.read_text()
    spoilt.write_text(text.replace('    <origin xyz="0.0925 0.0945 0"/>\n', ""))
    assert UrdfDescription(spoilt).mount("front_left_wheel").y_m == 0.0
    bare = text.replace('<child link="front_left_wheel_link"/>', '<child link="bare"/>').replace(
        "</robot>", '<link name="bare"/></robot>'
    )
    spoilt.write_text(bare.replace('<link name="front_left_wheel_link">', '<link name="infrared_link_2">'))
    with pytest.raises(DescriptionError, match="Multiple roots"):
        UrdfDescription(spoilt)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("no xml", "not a URDF"),
        ("<robot name='r'><link/></robot>", "not a URDF"),
        ("<robot name='r'/>", "No roots"),
        (tree(joint("j", "a", "b"), "<link name='a'/>"), "two links have the name 'a'"),
        (tree(joint("j", "a", "b"), joint("j", "b", "c")), "two joints have the name 'j'"),
        (tree(joint("j", "a", "nowhere"), joint("k", "a", "b")), "'j' names the link 'nowhere'"),
        (tree(joint("j", "a", "b"), joint("k", "a", "b")), "'b' is the child of two joints"),
        (tree(joint("j", "b", "c"), joint("k", "c", "b")), "'[bc]' is its own ancestor"),
        (tree(joint("j", "a", "b", "<axis/>")), "lacks a required attribute"),
        (tree(joint("j", "a", "b", "<axis xyz='1 0'/>")), "Invalid vector length"),
    ],
)
def test_what_is_no_description_is_refused(tmp_path: Path, text: str, told: str) -> None:
    """Not XML, not a robot, no link, no tree of links, an element that lacks something: said with the file's name."""
    path = tmp_path / "bad.urdf"
    path.write_text(text)
    with pytest.raises(DescriptionError, match=rf"bad\.urdf: .*{told}"):
        UrdfDescription(path)


def test_a_missing_description_is_named(tmp_path: Path) -> None:
    """The path, and why it cannot be read."""
    with pytest.raises(DescriptionError, match=r"absent\.urdf: cannot be read: No such file"):
        UrdfDescription(tmp_path / "absent.urdf")


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            'izz="0.02706"',
            'izz="0.03"',
            "base_link: the moments of inertia are 0.00566, 0.02297 and 0.03 kg m2, which no body has",
        ),
        ('ixx="0.00566"', 'ixx="0"', "base_link: the moments of inertia are 0, 0.02297 and 0.02706 kg m2"),
        (
            '<mass value="2.6"/>',
            '<mass value="-2.6"/>',
            "base_link: the mass is -2.6 kg, expected more than 0",
        ),
    ],
)
def test_a_link_that_no_body_can_be_is_told(spoilt: Path, old: str, new: str, told: str) -> None:
    """Of three moments of inertia two together are at least the third, none is zero, and no mass is negative."""
    (problem,) = differences(spoil(spoilt, old, new), KHAN)
    assert problem.startswith(told)


@pytest.mark.parametrize("robot", ["chefbot", "khan"])
def test_inertias_are_those_of_the_shapes(robot: str) -> None:
    """ChefBot's body, a cylinder of 5.6 kg: 5.6 * 0.18^2 / 2; KHAN's, a box of 2.6 kg: 2.6 / 12 * (0.32^2 + 0.15^2)."""
    upright = {"chefbot": 5.6 * 0.18**2 / 2, "khan": 2.6 / 12 * (0.32**2 + 0.15**2)}[robot]
    mass_kg, inertia_kg_m2 = UrdfDescription(written(robot)).inertias()["base_link"]
    assert mass_kg == {"chefbot": 5.6, "khan": 2.6}[robot]
    assert inertia_kg_m2[2, 2] == pytest.approx(upright, rel=0.005)
