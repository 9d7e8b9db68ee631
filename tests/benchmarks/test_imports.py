"""Each benchmark can still be loaded: most are run by hand, and seldom."""

from importlib import import_module
from pathlib import Path

import pytest

import benchmarks

OURS = ("benchmarks", "chefbotd", "examples", "firmware_protocol", "tests")
MODULES = sorted(path.stem for path in Path(benchmarks.__path__[0]).glob("*.py") if path.stem != "__main__")


@pytest.mark.parametrize("name", MODULES)
def test_a_benchmark_finds_all_that_it_names_of_ours(name: str) -> None:
    """What is missing of others' packages, an extra that is not installed, is no fault of it."""
    try:
        import_module(f"benchmarks.{name}")
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] in OURS:
            raise
        pytest.skip(f"{error.name} is not installed")
