"""``chefbot-fleet run MAP.yaml BROKER``: the manager of many robots."""

import asyncio
import contextlib
import math
import secrets
import time
from pathlib import Path

import click
import yaml
from chefbot_vda5050.broker import BrokerParameters

from chefbot_fleet.fleet import Fleet, FleetParameters
from chefbot_fleet.lanes import LaneParameters, find_lanes
from chefbot_fleet.routes import Pace
from chefbot_fleet.store import Store
from chefbotd.mapping.map_server import parse_description, parse_image

PATH = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.group(context_settings={"auto_envvar_prefix": "CHEFBOT_FLEET"})
def main() -> None:
    """Many robots over VDA 5050."""


@main.command()
@click.argument("map_file", metavar="MAP.yaml", type=PATH)
@click.argument("places_file", metavar="PLACES.yaml", type=PATH)
@click.argument("broker", metavar="BROKER[:PORT]")
@click.option("--database", type=click.Path(path_type=Path), default=Path("fleet.db"), show_default=True)
@click.option("--map-id", help="as the robots call the map  [default: the file's name]")
@click.option("--robots", default=6, show_default=True, help="so many homes are chosen")
@click.option("--radius-m", default=0.2, show_default=True, help="of the largest robot")
@click.option("--separation-m", default=0.6, show_default=True, help="between two robots' middles")
@click.option("--speed-m-s", default=0.3, show_default=True)
@click.option("--lost-after-s", default=45.0, show_default=True, help="without a state")
@click.option("--lease-s", default=math.inf, help="a vanished robot's place is freed after  [default: never]")
@click.option("--interface", default="uagv", show_default=True, help="first level of all topics")
@click.option("--major", default="v2", show_default=True, help="second level of all topics")
@click.option("--user", help="for the broker")
@click.option("--password-file", type=PATH)
@click.option("--host", default="127.0.0.1", show_default=True, help="of the page")
@click.option("--port", default=7340, show_default=True)
@click.option("--token-file", type=PATH, help="the token for commands  [default: a new one is printed]")
def run(map_file: Path, places_file: Path, broker: str, **options: object) -> None:
    """Drive all robots on BROKER over the lanes of a map. PLACES.yaml names positions: ``table: [1.5, 2]``."""
    token_file = options["token_file"]
    token = token_file.read_text().strip() if isinstance(token_file, Path) else secrets.token_urlsafe(16)
    if token_file is None:
        click.echo(f"token for commands: {token}")
    fleet = _fleet(map_file, places_file, options)
    host, _, port = broker.partition(":")
    password_file = options["password_file"]
    password = password_file.read_text().strip() if isinstance(password_file, Path) else None
    user = str(options["user"]) if options["user"] else None
    parameters = BrokerParameters(host, int(port or 1883), user, password)

    from chefbot_fleet.manager import Manager

    manager = Manager(
        fleet, parameters, interface=str(options["interface"]), major_version=str(options["major"])
    )
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(manager.run(str(options["host"]), int(str(options["port"])), token))


def _fleet(map_file: Path, places_file: Path, options: dict[str, object]) -> Fleet:
    def number(name: str) -> float:
        return float(str(options[name]))

    description = parse_description(map_file.read_text(encoding="utf-8"), str(map_file))
    grid = parse_image((map_file.parent / description.image).read_bytes(), description)
    places = yaml.safe_load(places_file.read_text(encoding="utf-8"))
    lanes = LaneParameters(radius_m=number("radius_m"), separation_m=number("separation_m"))
    try:
        roadmap = find_lanes(
            grid, lanes, {str(name): (float(x), float(y)) for name, (x, y) in places.items()}
        )
        homes = roadmap.homes(int(number("robots")))
    except (AttributeError, TypeError, ValueError) as error:
        raise click.ClickException(f"{places_file}: {error}") from error
    parameters = FleetParameters(
        str(options["map_id"] or map_file.stem), number("lost_after_s"), number("lease_s")
    )
    store = Store(Path(str(options["database"])))
    return Fleet(roadmap, homes, store, Pace(number("speed_m_s")), parameters, time.time())
