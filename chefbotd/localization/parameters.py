"""All parameters of localization together."""

from pydantic import Field

from chefbotd.core.parameters import Parameters
from chefbotd.localization.global_search import GlobalSearchParameters
from chefbotd.localization.hypotheses import CertaintyParameters
from chefbotd.localization.mount_check import MountCheckParameters
from chefbotd.localization.searching import SearchingParameters, SearchSettings
from chefbotd.localization.smoothing import SmoothingParameters
from chefbotd.localization.surface_map import SurfaceMapParameters
from chefbotd.localization.tracking import TrackingParameters


class WatchParameters(Parameters):
    """When scans that fit or misfit change the state."""

    uncertain_after_s: float = Field(default=0.5, ge=0, le=10)
    lost_after_s: float = Field(default=1.5, gt=0, le=60)
    lost_after_scans: int = Field(default=5, ge=1, le=1000)
    """A pose is given up when its scans misfit for so long, and are so many."""
    weak_fit: float = Field(default=0.6, gt=0, le=1)
    weak_after_s: float = Field(default=20.0, gt=0, le=600)
    """A pose whose scans fit worse than this is uncertain as well, and given up after so long."""
    no_evidence_after_s: float = Field(default=10.0, gt=0, le=600)
    """An uncertain pose from which nothing is seen that the map knows is given up after so long."""
    confirmed_fit: float = Field(default=0.65, gt=0, le=1)
    confirmed_scans: int = Field(default=3, ge=1, le=100)
    """So many scans in a row that fit so well end a doubt."""
    max_sigma_m: float = Field(default=0.5, gt=0, le=10)
    max_sigma_rad: float = Field(default=0.5, gt=0, le=3.2)
    """An estimate that is less sure than this is uncertain, whatever fits."""
    given_m: float = Field(default=0.3, gt=0, le=5)
    given_rad: float = Field(default=0.2, gt=0, le=3.2)
    """One sigma of a pose that a person gives."""


class LocalizationParameters(Parameters):
    """All of it."""

    surfaces: SurfaceMapParameters = SurfaceMapParameters()
    tracking: TrackingParameters = TrackingParameters()
    search: GlobalSearchParameters = GlobalSearchParameters()
    searching: SearchingParameters = SearchingParameters()
    certainty: CertaintyParameters = CertaintyParameters()
    watch: WatchParameters = WatchParameters()
    smoothing: SmoothingParameters = SmoothingParameters()
    mount_check: MountCheckParameters = MountCheckParameters()

    @property
    def for_search(self) -> SearchSettings:
        """What a search needs of it."""
        return SearchSettings(self.tracking, self.search, self.certainty, self.searching)
