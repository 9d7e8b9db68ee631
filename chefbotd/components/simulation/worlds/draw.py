"""Draws the maps of the buildings into this folder: run it with ``python -m`` after a change."""

import io
import sys
from pathlib import Path

from PIL import Image

from chefbotd.components.maps.algorithms.map_server import to_description, to_image
from chefbotd.components.simulation.rooms import BUILDINGS
from chefbotd.core.occupancy_grid import OccupancyGrid

FOLDER = Path(__file__).parent


def files(name: str, grid: OccupancyGrid) -> dict[str, bytes]:
    """The YAML file and the image, by their names; as PNG, which is a fiftieth of the size of the same PGM."""
    image = f"{name}.png"
    with Image.open(io.BytesIO(to_image(grid))) as pixels, io.BytesIO() as data:
        pixels.save(data, format="PNG", optimize=True)
        return {f"{name}.yaml": to_description(grid, image).encode(), image: data.getvalue()}


def main(folder: Path = FOLDER) -> None:
    """Write the files of every building."""
    for name, building in BUILDINGS.items():
        for file, data in files(name, building.grid()).items():
            (folder / file).write_bytes(data)
            sys.stdout.write(f"{folder / file}\n")


if __name__ == "__main__":
    main()
