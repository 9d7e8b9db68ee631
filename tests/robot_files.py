"""Whole configurations with every key and comment, as people have them who copied one when packaged files were long."""

from pathlib import Path

FOLDER = Path(__file__).parent / "vectors" / "full_configurations"


def full(robot: str = "chefbot") -> Path:
    """The whole configuration of a packaged robot; ``test_packaged`` holds it to the packaged one."""
    return FOLDER / f"{robot}.toml"
