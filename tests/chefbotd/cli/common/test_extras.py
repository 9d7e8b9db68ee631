"""Imports of optional packages."""

import pytest

from chefbotd.cli.common.exits import Exit, ProgramError, extra, require


def test_a_missing_package_of_the_extra() -> None:
    """It becomes advice on what to install."""
    with pytest.raises(ProgramError, match=r"pip install 'chefbotd\[tune\]'") as caught, extra("tune", "a"):
        raise ModuleNotFoundError("No module named 'a.b'", name="a.b")
    assert caught.value.code is Exit.NOT_INSTALLED


def test_a_missing_shared_library() -> None:
    """An import that fails without a name is told in its own words."""
    with pytest.raises(ProgramError, match="no library for SDL2"), extra("joystick", "sdl2"):
        raise ImportError("no library for SDL2")


def test_any_other_failure_is_a_fault() -> None:
    """What is none of the extra's passes through."""
    with pytest.raises(ImportError), extra("tune", "a"):
        raise ImportError("cannot import name 'x'", name="chefbotd.cli.x")


def test_what_is_required_is_imported_here_and_now() -> None:
    """What is there passes; the first that is missing is told, with the extra that has it."""
    require("page", "json", "click")
    with pytest.raises(ProgramError, match=r"no_such_package.*pip install 'chefbotd\[page\]'"):
        require("page", "json", "no_such_package")
