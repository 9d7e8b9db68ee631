"""A gymnasium environment of the simulated robot: ``gymnasium.make("examples.learning:ChefBot-v0")``."""

import gymnasium

gymnasium.register(
    "ChefBot-v0", entry_point="examples.learning.environment:ChefBotEnv", max_episode_steps=300
)
