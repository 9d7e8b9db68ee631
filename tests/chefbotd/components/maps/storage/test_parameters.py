"""Where maps are kept, by the configuration and by what the process is given."""

from pathlib import Path

import pytest

from chefbotd.components.maps.storage.parameters import MapsParameters, folder_of
from chefbotd.settings import load
from tests.robot_files import full


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({"STATE_DIRECTORY": "/var/lib/chefbotd:/var/lib/more", "XDG_STATE_HOME": "/x"}, "/var/lib/chefbotd/maps"),
        ({"XDG_STATE_HOME": "/home/ann/state"}, "/home/ann/state/chefbotd/maps"),
        ({"XDG_STATE_HOME": "relative"}, "/home/ann/.local/state/chefbotd/maps"),
        ({}, "/home/ann/.local/state/chefbotd/maps"),
    ],
)  # fmt: skip
def test_without_a_configured_folder_it_is_the_services_or_the_users(
    monkeypatch: pytest.MonkeyPatch, environment: dict[str, str], expected: str
) -> None:
    """Systemd's first, then XDG's, which counts only where it is absolute."""
    monkeypatch.setenv("HOME", "/home/ann")
    assert folder_of(MapsParameters(), environment) == Path(expected)
    assert folder_of(MapsParameters(folder=Path("/srv/maps")), environment) == Path("/srv/maps")


def test_a_relative_folder_begins_at_the_configuration(tmp_path: Path) -> None:
    """Wherever the daemon was started. Without the section there are no maps."""
    text = full().read_text(encoding="utf-8")
    path = tmp_path / "robot.toml"
    path.write_text(f'{text}\n[maps]\nfolder = "mine"\n', encoding="utf-8")
    maps = load(path).maps
    assert maps is not None
    assert (maps.folder, maps.versions_kept) == (tmp_path / "mine", 3)
    assert load().maps is None
