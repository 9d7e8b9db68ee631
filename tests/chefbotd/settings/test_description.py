"""Descriptions against configurations."""

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner

from chefbotd.cli.common.exits import Exit
from chefbotd.cli.programs.chefbotd import main
from chefbotd.clock import run_virtual
from chefbotd.motion.kinematics import Side, WheelParameters
from chefbotd.settings import Settings, SettingsError, load, packaged
from chefbotd.settings.description import Description, DescriptionError
from chefbotd.settings.description_check import differences
from chefbotd.settings.urdf import urdf_of, wheel_places_x_m
from chefbotd.sim.chassis import Chassis, Wheel
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice

KHAN = load(packaged("khan"))


WRITTEN_BY_HAND = Path(__file__).parents[2] / "vectors" / "urdf"


def written(robot: str) -> Path:
    """A description of the robot that was written by hand, from the published numbers."""
    return WRITTEN_BY_HAND / f"{robot}.urdf"


@pytest.fixture
def spoilt(tmp_path: Path) -> Path:
    """A copy of KHAN's description to spoil."""
    copy = tmp_path / "khan.urdf"
    copy.write_text(written("khan").read_text())
    return copy


def spoil(path: Path, old: str, new: str) -> Description:
    """Replace text, which must be there, once; the description as it then is."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return Description(path)


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
    assert differences(Description(written(robot)), load(packaged(robot))) == []


def test_khan_has_its_published_numbers() -> None:
    """Radius 0.03 m, and 0.189 / 2 = 0.0945 m left and right of the middle."""
    khan = Description(written("khan"))
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


def test_what_calibration_finds_changes_no_description() -> None:
    """A robot that turns as if it were wider, on wheels that roll farther, is built as it was."""
    found = {
        "chassis.track_multiplier": 1.5,
        "chassis.left_radius_multiplier": 1.01,
        "chassis.right_radius_multiplier": 0.99,
    }
    assert differences(Description(written("khan")), load(packaged("khan"), overrides=found)) == []


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
    assert Description(spoilt).mount("front_left_wheel").y_m == 0.0
    bare = text.replace('<child link="front_left_wheel_link"/>', '<child link="bare"/>').replace(
        "</robot>", '<link name="bare"/></robot>'
    )
    spoilt.write_text(bare.replace('<link name="front_left_wheel_link">', '<link name="infrared_link_2">'))
    with pytest.raises(DescriptionError, match="Multiple roots"):
        Description(spoilt)


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
        (tree(joint("j", "a", "b", "<axis/>")), "lacks an attribute"),
        (tree(joint("j", "a", "b", "<axis xyz='1 0'/>")), "Invalid vector length"),
    ],
)
def test_what_is_no_description_is_refused(tmp_path: Path, text: str, told: str) -> None:
    """Not XML, not a robot, no link, no tree of links, an element that lacks something: said with the file's name."""
    path = tmp_path / "bad.urdf"
    path.write_text(text)
    with pytest.raises(DescriptionError, match=rf"bad\.urdf: .*{told}"):
        Description(path)


def test_a_missing_description_is_named(tmp_path: Path) -> None:
    """The path, and why it cannot be read."""
    with pytest.raises(DescriptionError, match=r"absent\.urdf: cannot be read: No such file"):
        Description(tmp_path / "absent.urdf")


Command = tuple[str, ...]
OF_THE_SAME_OPINION: list[Command] = [
    ("check-config",),
    ("urdf",),
    ("simulate", "--config"),
    ("run", "--config"),
]


def own(folder: Path, urdf: str | None, *, change: tuple[str, str] = ("", "")) -> Path:
    """A copy of KHAN's configuration that names a description beside it."""
    path = folder / "robot.toml"
    text = packaged("khan").read_text().replace('# description = "my.urdf"', 'description = "my.urdf"', 1)
    assert change[0] in text
    path.write_text(text.replace(*change, 1))
    if urdf is not None:
        (folder / "my.urdf").write_text(urdf)
    return path


@pytest.mark.parametrize("command", OF_THE_SAME_OPINION, ids=lambda command: command[0])
def test_a_description_of_ones_own_is_held_against_the_configuration(
    tmp_path: Path, command: Command
) -> None:
    """A track that differs is not valid, whatever the command, with both numbers, a line for each of the wheels."""
    path = own(tmp_path, written("khan").read_text(), change=("track_width_m = 0.189", "track_width_m = 0.2"))
    result = CliRunner().invoke(main, [*command, str(path)])
    assert result.exit_code == Exit.BAD_CONFIGURATION
    first, *lines = result.stderr.splitlines()
    assert first.endswith("my.urdf does not describe the robot that is configured:")
    assert lines[:1] == [f"front_left_wheel: y is 0.0945 m, expected 0.1 m (half {TRACK} left)"]
    assert len(lines) == 4


def test_check_config_tells_scripts_each_difference(tmp_path: Path) -> None:
    """With ``--json`` they are a list."""
    path = own(tmp_path, written("khan").read_text(), change=("mount_x_m = 0.06", "mount_x_m = 0.05"))
    result = CliRunner().invoke(main, ["check-config", "--json", str(path)])
    assert json.loads(result.stderr)["error"]["differences"] == [
        "infrared_joint: x is 0.06 m, expected 0.05 m (infrared.front.mount_x_m)"
    ]


@pytest.mark.parametrize(
    ("urdf", "told"), [(None, "my.urdf: cannot be read: No such file"), ("spoilt", "my.urdf: not a URDF")]
)
def test_a_description_of_ones_own_must_be_there(tmp_path: Path, urdf: str | None, told: str) -> None:
    """One that is missing or broken is told with its path."""
    with pytest.raises(SettingsError, match=told):
        load(own(tmp_path, urdf))


@pytest.mark.parametrize("robot", ["chefbot", "khan"])
def test_the_description_that_is_made_is_the_one_written_by_hand(robot: str, tmp_path: Path) -> None:
    """Every joint is where the other has it, masses are equal, and moments of inertia, which it rounds, within 0.5 %."""
    path = tmp_path / "made.urdf"
    path.write_text(urdf_of(load(packaged(robot))))
    made, hand = Description(path), Description(written(robot))
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
    made = Description(path)
    assert differences(made, settings) == []
    assert made.place("front_left_wheel") == pytest.approx((0.125, 0.15, 0.04))
    assert made.place("rear_right_wheel") == pytest.approx((-0.125, -0.15, 0.03))
    assert made.place("infrared_joint") == pytest.approx((0.11, -0.07, 0.2))
    assert made.mount("infrared_joint").heading_rad == pytest.approx(0.7)


def test_wheels_are_described_where_they_are_simulated() -> None:
    """Three wheels on one side and two on the other, in mixed order: as the simulator spreads them over 0.5 m."""
    sides = "LRLRL"
    wheels = [
        WheelParameters(name=str(index), side=Side.LEFT if side == "L" else Side.RIGHT, radius_m=0.03)
        for index, side in enumerate(sides)
    ]
    simulated = Chassis(tuple(Wheel(side == "L", 0.03) for side in sides), 0.2, 900.0)
    assert wheel_places_x_m(wheels, 0.5) == [0.25, 0.25, 0.0, -0.25, -0.25]
    assert tuple(wheel_places_x_m(wheels, 0.5)) == simulated.places_x_m(0.5)


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


def served(settings: Settings) -> str | None:
    """What a daemon with this configuration answers to ``get_description``."""

    async def scenario() -> str | None:
        async with running_daemon(FakeSerialDevice(), settings) as client:
            urdf: str | None = (await client.call("get_description"))["urdf"]
            return urdf

    return run_virtual(scenario())


def test_the_daemon_serves_the_description_that_is_made() -> None:
    """With the radius that is configured."""
    settings = load(overrides={"chassis.wheels.0.radius_m": 0.047})
    assert served(settings) == urdf_of(settings)
    assert 'cylinder radius="0.047"' in urdf_of(settings)


def test_the_daemon_serves_a_description_of_ones_own_as_it_stands(tmp_path: Path) -> None:
    """Byte for byte."""
    text = written("khan").read_text()
    assert served(load(own(tmp_path, text))) == text


def test_a_description_that_is_gone_keeps_nobody_from_driving(tmp_path: Path) -> None:
    """It was there when the configuration was read: null."""
    settings = load(own(tmp_path, written("khan").read_text()))
    (tmp_path / "my.urdf").unlink()
    assert served(settings) is None


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
    mass_kg, inertia_kg_m2 = Description(written(robot)).inertias()["base_link"]
    assert mass_kg == {"chefbot": 5.6, "khan": 2.6}[robot]
    assert inertia_kg_m2[2, 2] == pytest.approx(upright, rel=0.005)
