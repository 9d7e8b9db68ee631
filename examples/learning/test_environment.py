"""The environment keeps gymnasium's rules, and can be solved."""

import contextlib
from collections.abc import Iterator

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from examples.learning.environment import ChefBotEnv, Row

NAME = "examples.learning:ChefBot-v0"
DISTANCE, BEARING = 24, 25


@pytest.fixture
def env() -> Iterator[gymnasium.Env[Row, Row]]:
    """The environment as a student makes it."""
    with gymnasium.make(NAME) as made:
        yield made


def test_gymnasiums_own_checker_finds_nothing(env: gymnasium.Env[Row, Row]) -> None:
    """Spaces, types, and that a seed decides everything; its warnings are errors here."""
    check_env(env.unwrapped)


def test_a_robot_that_turns_towards_the_goal_and_drives_comes_there(env: gymnasium.Env[Row, Row]) -> None:
    """The rewards are the metres that it came nearer and 10 for being there, without a touch."""
    seen, _ = env.reset(seed=3)
    first_m, rewards, ended, cut_off = seen[DISTANCE] * 4.0, 0.0, False, False
    while not (ended or cut_off):
        bearing = float(seen[BEARING])
        seen, reward, ended, cut_off, info = env.step(
            np.array([0.8 if abs(bearing) < 0.15 else 0.0, 2.0 * bearing], np.float32)
        )
        rewards += float(reward)
    assert ended
    assert info["distance_m"] < 0.15
    assert rewards == pytest.approx(first_m - info["distance_m"] + 10.0, abs=1e-3)


def test_the_same_seed_and_actions_give_the_same_episode() -> None:
    """Observation by observation, with noise; another seed gives another one."""

    def episode(seed: int) -> list[Row]:
        with contextlib.closing(ChefBotEnv()) as env:
            seen = [env.reset(seed=seed)[0]]
            return seen + [env.step(np.array([0.3, 0.2], np.float32))[0] for _ in range(5)]

    first, again, other = episode(5), episode(5), episode(6)
    assert all(np.array_equal(one, two) for one, two in zip(first, again, strict=True))
    assert not np.array_equal(first[-1], other[-1])
