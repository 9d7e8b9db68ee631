"""The parameters of stored maps: the folder, and how many versions are kept."""

from collections.abc import Mapping
from pathlib import Path

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.storage import state_folder


class MapsParameters(Parameters):
    """Without a ``folder`` the maps are in ``maps`` of the folder that systemd gives the service, or of the user's."""

    folder: Path | None = Field(
        None,
        description="Where maps are kept; left out, the service's state folder or your own",
    )
    versions_kept: int = Field(
        3, ge=1, le=100, description="So many versions of each map are kept; older ones are removed"
    )


def folder_of(parameters: MapsParameters, environment: Mapping[str, str], *, simulated: bool = False) -> Path:
    """The configured folder; else the one for state: see ``state_folder``."""
    return parameters.folder or state_folder("maps", environment, simulated=simulated)
