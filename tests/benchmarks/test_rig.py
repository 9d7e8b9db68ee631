"""The configuration that a daemon under test is given."""

import tomllib

from benchmarks.rig import to_toml
from chefbotd.settings import packaged
from chefbotd.settings.loader import read_values


def test_the_packaged_configuration_survives_being_written_again() -> None:
    """Tables, empty tables, arrays of tables and every kind of scalar."""
    values = read_values(packaged())
    assert tomllib.loads(to_toml(values)) == values
