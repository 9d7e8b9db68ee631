"""A process that saves maps is killed by the kernel, in the middle of whatever it does."""

import random
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from chefbotd.components.maps.storage.contents import read_grid, read_map_server, read_slam, save
from chefbotd.components.maps.storage.store import MapStore
from tests.budget import sample
from tests.chefbotd.components.maps.storage.test_store import grid, same

SAVES_FOR_EVER = """
import sys
from pathlib import Path
import numpy as np
from chefbotd.core.geometry import Pose2D
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.components.maps.storage.contents import autosave, save
from chefbotd.components.maps.storage.store import MapStore

store = MapStore(Path(sys.argv[1]), 2)
for number in range(1000000):
    grid = OccupancyGrid(0.05, Pose2D(), np.full((200 + number % 50, 300), number % 2 * 100, np.int8))
    slam = {"number": np.array(number), "rest": np.zeros(100000)}
    save(store, "flat", grid, slam)
    autosave(store, grid, slam)
    print(number, flush=True)
"""


@pytest.mark.parametrize("seed", sample(range(8), fast=1))
def test_who_is_killed_while_saving_leaves_the_old_map_or_the_new_one(tmp_path: Path, seed: int) -> None:
    """At a moment by chance: cells, SLAM's state and the public files are of one save, the last told or the next."""
    rng = random.Random(seed)
    for _ in range(3):
        with subprocess.Popen(
            [sys.executable, "-c", SAVES_FOR_EVER, str(tmp_path)], stdout=subprocess.PIPE, text=True
        ) as saving:
            assert saving.stdout is not None
            saving.stdout.readline()
            time.sleep(rng.uniform(0.0, 0.2))
            saving.kill()
            told = [0, *(int(line) for line in saving.stdout.read().split())][-1]
        store = MapStore(tmp_path, 2)
        public = read_map_server(tmp_path / "flat.yaml").grid
        slam = read_slam(store, "flat")
        assert slam is not None
        number = int(slam["number"])
        assert number in (told, told + 1)
        cells = read_grid(store, "flat")
        assert cells.percent.shape == (200 + number % 50, 300)
        assert np.all(cells.percent == number % 2 * 100)
        assert public.percent.shape[0] in (200 + number % 50, 200 + (number - 1) % 50)
        assert len(np.unique(public.percent)) == 1
        autosaved = store.read_autosave()
        assert autosaved is not None
        save(store, "other", grid(seed))
        assert same(read_map_server(tmp_path / "flat.yaml").grid, cells)
        assert not list(tmp_path.rglob(".tmp-*"))
