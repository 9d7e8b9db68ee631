"""Keys of the configuration that nothing sets are constants, not keys."""

from typing import Any

from chefbotd.core.parameters import Parameters, section
from chefbotd.settings import Settings
from tests.unset_keys import keys_of, page_tables, set_keys, tables_of, unset_here, unset_keys


class Wheel(Parameters):
    """A wheel of a small robot."""

    radius_m: float = 0.1
    grip: float = 0.5


class Robot(Parameters):
    """A small robot: wheels by name, and lidars in a list."""

    speed_m_s: float = 1.0
    wheels: dict[str, Wheel] = {}
    lidar: tuple[Wheel, ...] = ()
    spare: Wheel = section()


KEYS = {"speed_m_s"} | {
    f"{table}.{key}" for table in ("wheels", "lidar", "spare") for key in Wheel.model_fields
}


def test_every_key_of_a_model_has_a_path_without_names_and_numbers() -> None:
    """One for all wheels, one for all lidars."""
    assert set(keys_of(Robot)) == KEYS


def test_a_table_sets_a_key_at_its_place_alone() -> None:
    """Left's radius sets the key of all wheels, and neither the lidar's nor the spare wheel's."""
    table: dict[str, Any] = {"wheels": {"left": {"radius_m": 0.2}}, "lidar": [{"grip": 1.0}], "spare": False}
    named: dict[str, Any] = {"lidar": {"front": {"radius_m": 0.1}}}
    assert KEYS - unset_keys(Robot, [table], []) == {"wheels.radius_m", "lidar.grip"}
    assert KEYS - unset_keys(Robot, [named], []) == {"lidar.radius_m"}


def test_a_key_that_the_model_lacks_is_told_too() -> None:
    """At its place, whatever it holds."""
    table: dict[str, Any] = {"spare": {"size": 1, "more": {"size": 2}}, "colour": "red"}
    assert list(set_keys(Robot, table)) == ["spare.size", "spare.more", "colour"]


def test_a_program_sets_a_key_by_its_path_or_its_name() -> None:
    """As a string, and as the name of an argument, where two underlines are a dot; a comment sets nothing."""
    program = 'run({"spare.grip": 1}, wheels__grip=2, speed_m_s=3)  # radius_m\n'
    assert KEYS - unset_keys(Robot, [], [program]) == {"spare.grip", "wheels.grip", "speed_m_s"}


def test_a_page_sets_what_its_blocks_of_toml_have() -> None:
    """Fenced ones, also in a list, and indented ones; neither prose nor a shell's."""
    page = "a = 1\n\n```toml\nb = 2\n```\n\n- c\n  ```toml\n  d = 3\n  ```\n\n    [e]\n    f = 4\n\n```sh\ng = 5\n```\n"
    assert list(tables_of(page)) == [{"b": 2}, {"d": 3}, {"e": {"f": 4}}]


def test_every_key_is_set_somewhere() -> None:
    """Else it becomes a constant (``retired``), or a shipped configuration or a page shows who would set it."""
    unset = unset_here()
    assert not unset, f"set nowhere: {', '.join(sorted(unset))}"


def test_what_the_pages_set_are_keys() -> None:
    """A page's block has no key that a configuration would refuse, but for a stranger's section."""
    keys = set(keys_of(Settings))
    sections = {key.partition(".")[0] for key in keys}
    shown = {path for table in page_tables() for path in set_keys(Settings, table) if "." in path}
    unknown = {path for path in shown - keys if path.partition(".")[0] in sections}
    assert len(shown) > 50
    assert not unknown, f"no such key: {', '.join(sorted(unknown))}"
