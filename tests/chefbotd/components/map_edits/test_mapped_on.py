"""A map that is extended by mapping on: its zones and edits lie where they were, in metres."""

import math
from pathlib import Path

from chefbotd.clock import run_virtual
from chefbotd.components.maps.map_image import MapImage
from tests.chefbotd.components.mapping.test_mapping import scene
from tests.chefbotd.components.worker.skills.drives import TRUTH


def square(x_m: float, y_m: float) -> tuple[tuple[float, float], ...]:
    """The corners of 0.4 by 0.4 m about a point."""
    return tuple((x_m + dx, y_m + dy) for dx, dy in ((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2)))


def percent_at(image: MapImage, x_m: float, y_m: float) -> int:
    """The cell at a point of the map."""
    grid = image.grid()
    x_m, y_m = x_m - image.x_m, y_m - image.y_m
    cos, sin = math.cos(image.heading_rad), math.sin(image.heading_rad)
    column, row = (cos * x_m + sin * y_m) / image.resolution_m, (cos * y_m - sin * x_m) / image.resolution_m
    return int(grid.percent[math.floor(row), math.floor(column)])


def test_zones_and_edits_stay_where_they_were_when_mapping_goes_on(tmp_path: Path) -> None:
    """The map gets a second version, drawn anew from more scans; what was drawn on the first is drawn on it, too."""
    wall_m = (1.0, 0.0)  # from where the map was begun, on the way that was driven
    erased_m = (0.4, 0.0)

    async def play() -> None:
        async with scene(tmp_path) as s:
            await s.client.start_mapping()
            await s.drive(0, 60)
            first = await s.client.finish_mapping("flat")
            before = await s.client.get_map()
            await s.client.save_zone(square(0.0, 1.0), name="rug", confirmed=True)
            at_x, at_y = wall_m
            await s.client.edit_map("wall", ((at_x, at_y - 0.2), (at_x, at_y + 0.2)), confirmed=True)
            await s.client.edit_map("erase", square(*erased_m), to="unknown", confirmed=True)
            zones, edits = await s.client.list_zones(), await s.client.list_map_edits()
            assert (percent_at(await s.client.get_map(), *wall_m), len(edits.edits)) == (100, 2)
            files = {
                name: (tmp_path / "flat.map" / name).read_bytes() for name in ("zones.yaml", "edits.json")
            }
            await s.client.start_mapping("flat")
            await s.drive(60, 120)
            saved = await s.client.finish_mapping("flat")
            assert (saved.version, saved.keyframes > first.keyframes) == (2, True)
            assert (await s.client.list_zones(), await s.client.list_map_edits()) == (zones, edits)
            after = await s.client.get_map()
            assert after.version == 2
            assert (percent_at(before, *wall_m), percent_at(after, *wall_m)) == (0, 100)
            assert (percent_at(before, *erased_m), percent_at(after, *erased_m)) == (0, -1)
            for name, content in files.items():
                assert (tmp_path / "flat.map" / name).read_bytes() == content

    assert len(TRUTH) > 120
    run_virtual(play())
