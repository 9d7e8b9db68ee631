"""The program that reads map files into the store: `python -m chefbotd.maps.importing ORDER`.

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

from chefbotd.core.commands import RefusalKind
from chefbotd.core.parameters import Parameters
from chefbotd.maps.disk import Content, MapStoreError
from chefbotd.maps.manifest import GRAPH
from chefbotd.maps.store import MapStore

NICENESS = 10
MOST_MEMORY_BYTES = 3 << 30
"""Of addresses, which numpy's libraries take generously."""

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
        _say(version=_import(order))
    except MapStoreError as error:
        _say(error=error.kind, message=str(error))
    except MemoryError:
        _say(error=RefusalKind.MAP_UNREADABLE, message=f"{order.yaml}: the image is too large for the memory")
    return 0


def _import(order: Order) -> int:
    from chefbotd.maps.contents import contents_of, extent_of, read_map_server

    store = MapStore(order.folder, order.versions_kept)
    _progress(0)
    grid = read_map_server(order.yaml).grid
    contents = contents_of(grid)
    if order.keeps_graph and (graph := _graph(store, order.name)) is not None:
        contents[GRAPH] = graph
    _progress(1)
    version = store.save(order.name, contents, extent_of(grid), order.source).manifest.version
    _progress(2)
    return version


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
