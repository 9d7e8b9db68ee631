"""Descriptions against configurations."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from chefbotd.cli.daemon import main
from chefbotd.cli.exits import Exit
from chefbotd.clock import run_virtual
from chefbotd.description import Description, DescriptionError, differences
from chefbotd.settings import Settings, load, packaged
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice

KHAN = load(packaged("khan")).chassis


def urdf_of(robot: str) -> Path:
    """The packaged description of a robot."""
    path = load(packaged(robot)).robot.description
    assert path is not None
    return path


@pytest.fixture
def spoilt(tmp_path: Path) -> Path:
    """A copy of KHAN's description to spoil."""
    copy = tmp_path / "khan.urdf"
    copy.write_text(urdf_of("khan").read_text())
    return copy


def spoil(path: Path, old: str, new: str) -> Description:
    """Replace text, which must be there, once; the description as it then is."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return Description(path)


@pytest.mark.parametrize("robot", ["chefbot", "khan"])
def test_the_packaged_robots_are_what_they_are_described_as(robot: str) -> None:
    """Wheel names, radii and track of both URDFs are those of both configurations."""
    assert differences(Description(urdf_of(robot)), load(packaged(robot)).chassis) == []


def test_khan_has_its_published_numbers() -> None:
    """Radius 0.03 m, and 0.189 / 2 = 0.0945 m left and right of the middle."""
    khan = Description(urdf_of("khan"))
    assert [khan.left_m(name) for name in khan.wheel_names()] == [0.0945, -0.0945, 0.0945, -0.0945]
    assert {khan.radius_m(name) for name in khan.wheel_names()} == {0.03}


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            'name="rear_left_wheel" type',
            'name="hind_left_wheel" type',
            "the description has the wheels front_left_wheel, front_right_wheel, hind_left_wheel, rear_right_wheel, "
            "the configuration front_left_wheel, front_right_wheel, rear_left_wheel, rear_right_wheel",
        ),
        (
            '<collision>\n      <origin rpy="1.570796 0 0"/>\n      <geometry><cylinder radius="0.03"',
            '<collision>\n      <origin rpy="1.570796 0 0"/>\n      <geometry><cylinder radius="0.032"',
            "front_left_wheel has a radius of 0.032 m in the description, 0.03 m in the configuration",
        ),
        (
            '<collision>\n      <origin rpy="1.570796 0 0"/>\n      <geometry><cylinder radius="0.03" length="0.025"/>',
            '<collision>\n      <origin rpy="1.570796 0 0"/>\n      <geometry><sphere radius="0.03"/>',
            "front_left_wheel has no cylinder in the description, 0.03 m in the configuration",
        ),
        (
            '"0.0925 0.0945 0"',
            '"0.0925 0.1145 0"',
            "left and right wheels are 0.199 m apart in the description, track_width_m is 0.189 m in the configuration",
        ),
    ],
)
def test_a_difference_is_told_with_both_values(spoilt: Path, old: str, new: str, told: str) -> None:
    """A wheel by another name, a radius, a wheel without one, and a track of (0.1145 + 0.0945) / 2 + 0.0945 m."""
    assert differences(spoil(spoilt, old, new), KHAN) == [told]


def test_a_wheel_stands_where_its_joints_say_together(spoilt: Path) -> None:
    """With the base turned a quarter to the left, what was 0.0925 m ahead is 0.0925 m left."""
    turned = spoil(
        spoilt, '<origin xyz="0 0 0.03"/>', '<origin xyz="0 0 0.03" rpy="0 0 1.5707963267948966"/>'
    )
    assert turned.left_m("front_left_wheel") == pytest.approx(0.0925)
    assert turned.left_m("rear_right_wheel") == pytest.approx(-0.0925)


def test_a_joint_may_leave_its_origin_out(spoilt: Path) -> None:
    """It is then at its parent's, and a link without a body has no radius."""
    text = spoilt.read_text()
    spoilt.write_text(text.replace('    <origin xyz="0.0925 0.0945 0"/>\n', ""))
    assert Description(spoilt).left_m("front_left_wheel") == 0.0
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
    ],
)
def test_what_is_no_description_is_refused(tmp_path: Path, text: str, told: str) -> None:
    """Not XML, not a robot, no link: said with the file's name."""
    path = tmp_path / "bad.urdf"
    path.write_text(text)
    with pytest.raises(DescriptionError, match=rf"bad\.urdf: .*{told}"):
        Description(path)


def test_a_missing_description_is_named(tmp_path: Path) -> None:
    """The path, and why it cannot be read."""
    with pytest.raises(DescriptionError, match=r"absent\.urdf: cannot be read: No such file"):
        Description(tmp_path / "absent.urdf")


def checked(folder: Path, *, change: tuple[str, str] = ("", ""), urdf: str | None = None) -> tuple[int, str]:
    """The exit code and output of ``check-config`` on a copy of KHAN's configuration, with a description beside it."""
    path = folder / "robot.toml"
    path.write_text(packaged("khan").read_text().replace(*change, 1))
    if urdf is not None:
        (folder / "khan.urdf").write_text(urdf)
    result = CliRunner().invoke(main, ["check-config", str(path)])
    return result.exit_code, result.output


def test_check_config_holds_the_description_against_the_configuration(tmp_path: Path) -> None:
    """A track that differs is a configuration that is not valid, with both numbers."""
    code, output = checked(tmp_path, change=("track_width_m = 0.189", "track_width_m = 0.2"))
    assert code == Exit.BAD_CONFIGURATION
    assert "0.189 m apart in the description, track_width_m is 0.2 m" in " ".join(output.split())


def test_check_config_takes_the_description_beside_the_file_first(tmp_path: Path) -> None:
    """A spoilt one there is read instead of the packaged one, which serves where there is none."""
    assert checked(tmp_path)[0] == Exit.OK
    code, output = checked(tmp_path, urdf="spoilt")
    assert (code, "khan.urdf: not a URDF" in " ".join(output.split())) == (Exit.BAD_CONFIGURATION, True)


def test_a_robot_need_not_be_described(tmp_path: Path) -> None:
    """Without the key there is nothing to hold against it."""
    assert checked(tmp_path, change=('description = "khan.urdf"', ""))[0] == Exit.OK


def served(settings: Settings) -> str | None:
    """What a daemon with this configuration answers to ``get_description``."""

    async def scenario() -> str | None:
        async with running_daemon(FakeSerialDevice(), settings) as client:
            urdf: str | None = (await client.call("get_description"))["urdf"]
            return urdf

    return run_virtual(scenario())


def test_the_daemon_serves_the_description_as_it_stands() -> None:
    """ChefBot's own, byte for byte."""
    assert served(load()) == urdf_of("chefbot").read_text()


@pytest.mark.parametrize("named", [None, Path("absent.urdf")])
def test_a_daemon_without_a_description_runs_and_says_so(named: Path | None) -> None:
    """Whether none is named or it cannot be read: null."""
    settings = load()
    robot = settings.robot.model_copy(update={"description": named})
    assert served(settings.model_copy(update={"robot": robot})) is None
