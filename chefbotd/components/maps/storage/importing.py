"""The program that reads map files into the store: `python -m chefbotd.components.maps.storage.importing ORDER`.

It is a process of its own, because an image may be large, or made to take all memory, and the daemon needs no numpy
otherwise. ORDER is an ``Order`` as JSON. Each line of the output is JSON: how far it is, and at last the version that
was saved, or what is wrong.
"""

import json
import os
import resource
import sys
from pathlib import Path
from typing import Any

from chefbotd.components.maps.storage.disk import Content, MapStoreError
from chefbotd.components.maps.storage.manifest import GRAPH
from chefbotd.components.maps.storage.store import MapStore
from chefbotd.core.commands import RefusalKind
from chefbotd.core.parameters import Parameters

NICENESS = 10
MOST_MEMORY_BYTES = 3 << 30
"""Of addresses, which numpy's libraries take generously."""

MARGIN_M = 1.0
"""So much of what is unknown stays around what is known: gmapping's own size is 200 by 200 m, whatever it saw."""

STEPS = ("reading", "saving", "saved")


class Order(Parameters):
    """What to import: ``yaml`` into the map ``name``. ``keeps_graph``: SLAM's state stays with the map."""

    folder: Path
    versions_kept: int
    name: str
    yaml: Path
    source: str
    keeps_graph: bool = False


def main(arguments: list[str]) -> int:
    """Run the import that the first argument tells."""
    os.nice(NICENESS)
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY_BYTES, resource.RLIM_INFINITY))
    order = Order.model_validate_json(arguments[1])
    try:
        version, notes = _import(order)
        _say(version=version, notes="; ".join(notes))
    except MapStoreError as error:
        _say(error=error.kind, message=str(error))
    except MemoryError:
        _say(error=RefusalKind.MAP_UNREADABLE, message=f"{order.yaml}: the image is too large for the memory")
    return 0


def _import(order: Order) -> tuple[int, tuple[str, ...]]:
    """The version that was saved, and what its owner might not expect of it."""
    from chefbotd.components.maps.storage.contents import contents_of, extent_of, read_map_server
    from chefbotd.components.maps.storage.limits import explain_size, why_doubtful
    from chefbotd.core.occupancy_grid import crop_grid

    store = MapStore(order.folder, order.versions_kept)
    _progress(0)
    read = read_map_server(order.yaml)
    grid, notes = crop_grid(read.grid, MARGIN_M), read.notes
    if grid is not read.grid:
        was, now = explain_size(extent_of(read.grid)), explain_size(extent_of(grid))
        notes += (f"what is unknown around the known was cropped: {was} became {now}",)
    if doubt := why_doubtful(extent_of(grid)):
        notes += (f"{doubt}: if that is right, say so when it is loaded",)
    contents = contents_of(grid)
    if order.keeps_graph and (graph := _graph(store, order.name)) is not None:
        contents[GRAPH] = graph
    _progress(1)
    version = store.save(order.name, contents, extent_of(grid), order.source).manifest.version
    _progress(2)
    return version, notes


def _graph(store: MapStore, name: str) -> Content | None:
    try:
        return store.read_file(name, GRAPH)[1]
    except MapStoreError:
        return None


def _progress(step: int) -> None:
    _say(done=step, total=len(STEPS) - 1, text=STEPS[step])


def _say(**message: Any) -> None:
    sys.stdout.write(json.dumps(message) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv))
