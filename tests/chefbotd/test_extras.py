"""What is proposed where an extra is missing fits the installation."""

from pathlib import Path

import pytest

from chefbotd import extras
from chefbotd.extras import how_to_add_extra, how_to_add_folder, pytest_of


@pytest.fixture
def prefix(tmp_path: Path) -> Path:
    """An environment with a pip."""
    (tmp_path / "venvs" / "chefbotd" / "bin").mkdir(parents=True)
    (tmp_path / "venvs" / "chefbotd" / "bin" / "pip").touch()
    return tmp_path / "venvs" / "chefbotd"


def test_an_environment_is_asked_by_the_path_of_its_pip(prefix: Path) -> None:
    """So it works whether the environment is activated or not, and never asks Debian's own Python."""
    assert how_to_add_extra("page", prefix) == f"{prefix}/bin/pip install 'chefbotd[page]'"
    assert how_to_add_folder("./addons/x", prefix) == f"{prefix}/bin/pip install ./addons/x"
    assert (
        how_to_add_folder("./my plug", prefix, editable=True)
        == f"{prefix}/bin/pip install --editable './my plug'"
    )


def test_an_environment_of_uv_has_no_pip(prefix: Path) -> None:
    """Uv installs into it."""
    (prefix / "bin" / "pip").unlink()
    assert how_to_add_extra("page", prefix) == f"uv pip install --python {prefix}/bin/python 'chefbotd[page]'"


def test_an_environment_of_pipx_is_changed_by_pipx(prefix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A user's own by its name alone, the whole system's with the home it was made with."""
    (prefix / "pipx_metadata.json").write_text("{}")
    sudo = f"sudo PIPX_HOME={prefix.parent.parent} pipx"
    assert how_to_add_extra("page", prefix) == f"{sudo} runpip chefbotd install 'chefbotd[page]'"
    monkeypatch.setattr(extras, "PIPX_HOMES", (prefix.parent.parent,))
    assert how_to_add_extra("page", prefix) == "pipx runpip chefbotd install 'chefbotd[page]'"
    assert how_to_add_folder("./addons/x", prefix) == "pipx inject --include-apps chefbotd ./addons/x"


def test_the_debian_package_is_built_with_it() -> None:
    """It has no pip, and dpkg would not know what that installs."""
    assert how_to_add_extra("navigation", Path("/opt/chefbotd")).startswith("'make deb WITH=navigation'")


def test_a_package_is_tested_where_it_was_added(prefix: Path) -> None:
    """The Debian package has no pytest: its line makes an environment in the folder."""
    assert pytest_of(prefix) == f"{prefix}/bin/pytest"
    assert pytest_of(Path("/opt/chefbotd")) == ".venv/bin/pytest"
