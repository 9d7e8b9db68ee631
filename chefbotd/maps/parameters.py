"""Where maps are kept, and how many versions of each."""

from collections.abc import Mapping
from pathlib import Path

from pydantic import Field

from chefbotd.core.parameters import Parameters


class MapsParameters(Parameters):
    """Without a ``folder`` the maps are in ``maps`` of the folder that systemd gives the service, or of the user's."""

    folder: Path | None = Field(
        None, description="where maps are kept; a relative path begins at the configuration's folder"
    )
    versions_kept: int = Field(3, ge=1, le=100, description="of each map; older ones are removed")


def folder_of(parameters: MapsParameters, environment: Mapping[str, str], *, simulated: bool = False) -> Path:
    """The configured folder; else ``StateDirectory=`` of the unit (systemd.exec(5)); else XDG's folder for state.

    Where none is configured, those of a simulated robot are in ``simulated_maps``, apart from the real one's.
    """
    if parameters.folder is not None:
        return parameters.folder
    name = "simulated_maps" if simulated else "maps"
    unit, _, _ = environment.get("STATE_DIRECTORY", "").partition(":")
    if unit:
        return Path(unit) / name
    own = environment.get("XDG_STATE_HOME", "")
    state = Path(own) if own.startswith("/") else Path.home() / ".local" / "state"
    return state / "chefbotd" / name
