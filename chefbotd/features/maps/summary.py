"""The entry of a map in ``list_maps``."""

from chefbotd.features.maps.methods import MapSummary
from chefbotd.maps.manifest import Manifest
from chefbotd.maps.store import StoredMap


def summary(stored: StoredMap, in_use: str | None) -> MapSummary:
    """A map as it is told."""
    manifest = stored.manifest
    whole = "foreign" if stored.plain else "damaged"
    told = "; ".join(f"version {number}: {why}" for number, why in (stored.damage or {}).items())
    return MapSummary(
        name=stored.name,
        condition="whole" if manifest is not None else whole,
        problem=told or None,
        in_use=stored.name == in_use,
        versions=stored.versions,
        **_facts(manifest),
    )


def _facts(manifest: Manifest | None) -> dict[str, object]:
    if manifest is None:
        names = ("version", "saved_at_s", "source", "resolution_m", "columns", "rows", "size_bytes")
        return {**dict.fromkeys(names), "can_go_on": False}
    return {
        "version": manifest.version,
        "saved_at_s": manifest.saved_at_s,
        "source": manifest.source,
        "resolution_m": manifest.extent.resolution_m,
        "columns": manifest.extent.columns,
        "rows": manifest.extent.rows,
        "size_bytes": manifest.total_bytes,
        "can_go_on": manifest.can_go_on,
    }
