"""``chefbot-fleet run MAP.yaml PLACES.yaml BROKER``: the manager of many robots."""

import asyncio
import contextlib
import math
import secrets
import sqlite3
import ssl
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import yaml
from chefbot_vda5050.cli import broker_of, broker_options

from chefbot_fleet.fleet import Fleet
from chefbot_fleet.lanes import LaneParameters, find_lanes, free_space
from chefbot_fleet.records import FleetParameters
from chefbot_fleet.roadmap import Point, Roadmap
from chefbot_fleet.routes import Pace
from chefbot_fleet.store import Store
from chefbotd.components.maps.storage.contents import read_map_server
from chefbotd.components.maps.storage.disk import MapStoreError
from chefbotd.core.occupancy_grid import OccupancyGrid
from chefbotd.rpc.parameters import is_loopback

REPEAT_S = 5.0
"""How often a search for lanes says that it goes on."""

PATH = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.group(context_settings={"auto_envvar_prefix": "CHEFBOT_FLEET"})
def main() -> None:
    """Many robots over VDA 5050."""


@main.command()
@click.argument("map_file", metavar="MAP.yaml", type=PATH)
@click.argument("places_file", metavar="PLACES.yaml", type=PATH)
@broker_options
@click.option("--database", type=click.Path(path_type=Path), default=Path("fleet.db"), show_default=True)
@click.option("--map-id", help="as the robots call the map  [default: the file's name]")
@click.option("--robots", default=6, show_default=True, help="so many homes are chosen")
@click.option("--radius-m", default=0.2, show_default=True, help="of the largest robot")
@click.option("--separation-m", default=0.6, show_default=True, help="between two robots' middles")
@click.option("--speed-m-s", default=0.3, show_default=True)
@click.option("--lost-after-s", default=45.0, show_default=True, help="without a state")
@click.option("--lease-s", default=math.inf, help="a vanished robot's place is freed after  [default: never]")
@click.option("--host", default="127.0.0.1", show_default=True, help="where the page listens")
@click.option("--port", default=7340, show_default=True, help="where the page listens")
@click.option("--host-name", "names", multiple=True, help="a name of this computer, beside its addresses")
@click.option("--page-certificate", type=PATH, help="the page's, with its key: needed beyond this computer")
@click.option("--token-file", type=PATH, help="the token for commands  [default: a new one is printed]")
def run(
    map_file: Path,
    places_file: Path,
    host: str,
    port: int,
    names: tuple[str, ...],
    page_certificate: Path | None,
    token_file: Path | None,
    **options: Any,
) -> None:
    """Drive all robots on BROKER over the lanes of a map. PLACES.yaml names positions: ``table: [1.5, 2]``."""
    if not is_loopback(host) and page_certificate is None:
        raise click.UsageError("beyond this computer the page needs --page-certificate: its token is secret")
    token = _token(token_file)

    from chefbot_fleet.manager import Manager, steady_clock
    from chefbot_fleet.walls import walls_of
    from chefbot_fleet.web import FleetPage

    clock = steady_clock()
    grid = _grid(map_file)
    fleet = _fleet(grid, map_file, places_file, options, clock())
    manager = Manager(
        fleet, broker_of(options), clock, interface=options["interface"], major_version=options["major"]
    )
    page = FleetPage(fleet, token, clock, names, walls_of(grid))
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(manager.run(page, host, port, _tls(page_certificate)))


def _token(path: Path | None) -> str:
    if path is None:
        token = secrets.token_urlsafe(16)
        click.echo(f"token for commands: {token}")
        return token
    token = path.read_text().strip()
    if not token:
        raise click.UsageError(f"{path} is empty: expected a token")
    return token


def _tls(certificate: Path | None) -> ssl.SSLContext | None:
    if certificate is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate)
    return context


def _grid(map_file: Path) -> OccupancyGrid:
    try:
        read = read_map_server(map_file)
    except MapStoreError as error:
        raise click.ClickException(str(error)) from error
    for note in read.notes:
        click.echo(f"{map_file}: {note}", err=True)
    return read.grid


def _places(path: Path) -> dict[str, Point]:
    try:
        places = yaml.safe_load(path.read_text(encoding="utf-8"))
        return {str(name): (float(x), float(y)) for name, (x, y) in places.items()}
    except yaml.YAMLError as error:
        raise click.ClickException(f"{path}: not valid YAML: {' '.join(str(error).split())}") from error
    except (OSError, AttributeError, TypeError, ValueError) as error:
        raise click.ClickException(
            f"{path}: expected names with a position each, 'table: [1.5, 2]': {error}"
        ) from error


def _fleet(
    grid: OccupancyGrid, map_file: Path, places_file: Path, options: dict[str, Any], now_s: float
) -> Fleet:
    def number(name: str) -> float:
        return float(str(options[name]))

    places = _places(places_file)
    lanes = LaneParameters(radius_m=number("radius_m"), separation_m=number("separation_m"))
    try:
        space = free_space(grid, lanes)
    except ValueError as error:
        raise click.ClickException(f"{map_file}: {error}") from error
    rows, columns = grid.percent.shape
    size = f"{columns * grid.resolution_m:.0f} by {rows * grid.resolution_m:.0f} m"
    with _telling(f"looking for lanes and homes in {map_file.name}, {size}"):
        roadmap, homes = _roadmap(grid, lanes, places, places_file, int(number("robots")))
    parameters = FleetParameters(
        str(options["map_id"] or map_file.stem), number("lost_after_s"), number("lease_s")
    )
    store = _store(Path(str(options["database"])))
    return Fleet(roadmap, homes, store, Pace(number("speed_m_s")), parameters, now_s, space)


def _roadmap(
    grid: OccupancyGrid, lanes: LaneParameters, places: dict[str, Point], places_file: Path, robots: int
) -> tuple[Roadmap, tuple[int, ...]]:
    try:
        roadmap = find_lanes(grid, lanes, places)
        return roadmap, roadmap.homes(robots)
    except ValueError as error:
        raise click.ClickException(f"{places_file}: {error}") from error


@contextlib.contextmanager
def _telling(what: str) -> Iterator[None]:
    """Say what is done now, that it goes on, and in the end how long it took: a large map takes minutes."""
    begun_s, is_done = time.monotonic(), threading.Event()

    def repeat() -> None:
        while not is_done.wait(REPEAT_S):
            click.echo(f"still {what}: {time.monotonic() - begun_s:.0f} s", err=True)

    click.echo(f"{what} ...", err=True)
    repeating = threading.Thread(target=repeat, daemon=True)
    repeating.start()
    try:
        yield
    finally:
        is_done.set()
        repeating.join()
    click.echo(f"found them in {time.monotonic() - begun_s:.0f} s", err=True)


def _store(path: Path) -> Store:
    try:
        return Store(path)
    except sqlite3.Error as error:
        raise click.ClickException(f"{path}: {error}; does another manager use it?") from error


if __name__ == "__main__":
    main()
