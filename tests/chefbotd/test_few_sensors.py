"""A robot with next to nothing: each sensor may be left out, and the battery too."""

from pathlib import Path

import pytest

from chefbotd.clock import run_virtual
from chefbotd.settings import Settings, SettingsError, load
from chefbotd.testing.daemon import simulated_robot
from tests.robot_files import full

SENSORS = ("ultrasonic", "imu", "battery")


def without(*sections: str) -> Settings:
    """The packaged ChefBot without these."""
    return load().model_copy(update=dict.fromkeys(sections))


@pytest.mark.parametrize("left_out", [("battery",), SENSORS])
def test_a_robot_without_these_drives(left_out: tuple[str, ...]) -> None:
    """It goes as far as it is told, and nothing of a battery is published or judged."""

    async def scenario() -> tuple[float, set[str], str]:
        async with simulated_robot(without(*left_out)) as robot:
            await robot.client.wait_until_armed()
            await robot.client.drive_for(2.0, linear_m_s=0.2)
            state = await robot.client.get_state()
            return state.odometry.x_m, set(state.topics), state.safety.mode

    went_m, topics, mode = run_virtual(scenario())
    assert 0.3 < went_m < 0.45
    assert "battery" not in topics
    assert mode == "armed"


@pytest.mark.parametrize("section", ["imu", "battery"])
def test_a_file_without_the_section_is_whole(section: str, tmp_path: Path) -> None:
    """`check-config` takes a file in which it was deleted."""
    text = full("chefbot").read_text(encoding="utf-8")
    begin = text.index(f"[{section}]")
    end = text.find("\n[", begin + 1)
    path = tmp_path / "chefbot.toml"
    path.write_text(text[:begin] + text[end + 1 :], encoding="utf-8")
    assert getattr(load(path), section) is None


@pytest.mark.parametrize("side", ["front", "front_left", "steered"])
def test_another_kind_of_robot_is_told_so(side: str, tmp_path: Path) -> None:
    """A wheel on neither side: the error says which robots are driven."""
    text = full("chefbot").read_text(encoding="utf-8").replace('side = "left"', f'side = "{side}"')
    path = tmp_path / "car.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SettingsError, match="differential drive, skid steer") as error:
        load(path)
    assert "Ackermann" in str(error.value)
    assert side in str(error.value)
