"""The page, its requests, and Prometheus. Reading is free to whoever reaches the port; commands need the token."""

import hmac
import sqlite3
from collections.abc import Awaitable, Callable, Collection
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Any

import msgspec
from aiohttp import web
from msgspec import Struct
from prometheus_client import CollectorRegistry, Gauge, generate_latest

from chefbot_fleet.fleet import Fleet
from chefbot_fleet.store import Correction, Stage
from chefbot_fleet.view import fleet_view, roadmap_view
from chefbot_fleet.walls import Walls
from chefbotd.transport.web import STOPS_SCRIPT
from chefbotd.transport.web.origin import is_own_host

PAGE = Path(__file__).parent / "page"
FILES = {
    "/": PAGE / "index.html",
    "/page.js": PAGE / "page.js",
    "/page.css": PAGE / "page.css",
    "/stops.js": STOPS_SCRIPT,
}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
MOST_BYTES = 64 * 1024

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class NewOrder(Struct, forbid_unknown_fields=True):
    """The body of ``POST /api/orders``; sent again with the same ``id`` it changes nothing."""

    id: Annotated[str, msgspec.Meta(min_length=1, max_length=100)]
    pick: str
    drop: str


class Cancelled(Struct, forbid_unknown_fields=True):
    """The body of ``POST /api/orders/cancel``; sent again it changes nothing."""

    id: str


class Removed(Struct, forbid_unknown_fields=True):
    """The body of ``POST /api/robots/remove``."""

    name: str


class FleetPage:
    """The requests that the manager answers.

    ``names`` are host names of this computer, beside its addresses; ``walls`` is a picture of the map.

    Raises:
        ValueError: the token is empty.
    """

    def __init__(
        self,
        fleet: Fleet,
        token: str,
        clock: Callable[[], float],
        names: Collection[str] = (),
        walls: Walls | None = None,
    ) -> None:
        if not token:
            raise ValueError("expected a token for commands, got an empty one")
        self._fleet, self._token, self._clock, self._names = fleet, token, clock, names
        self._walls = walls

    def application(self) -> web.Application:
        """The server's routes."""
        application = web.Application(client_max_size=MOST_BYTES, middlewares=[self._guard])
        for path, file in FILES.items():
            application.router.add_get(path, self._file(file))
        application.router.add_get("/walls.png", self._picture)
        application.router.add_get("/api/roadmap", self._roadmap)
        application.router.add_get("/api/fleet", self._state)
        application.router.add_get("/metrics", self._metrics)
        application.router.add_post("/api/orders", self._order)
        application.router.add_post("/api/orders/cancel", self._cancel)
        application.router.add_post("/api/robots/remove", self._remove)
        application.router.add_post("/api/corrections", self._correct)
        return application

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """This computer's name, and the token of a command; what cannot be done is an answer with a sentence."""
        if not is_own_host(request.headers.get("Host", ""), self._names):
            why = {"error": "this name is not the manager's: see --host-name"}
            return web.json_response(why, status=HTTPStatus.MISDIRECTED_REQUEST, headers=HEADERS)
        if request.method not in ("GET", "HEAD"):
            given = request.headers.get("Authorization", "").removeprefix("Bearer ")
            if not hmac.compare_digest(given.encode(errors="surrogateescape"), self._token.encode()):
                return web.json_response({"error": "this needs the token"}, status=401, headers=HEADERS)
        try:
            response = await handler(request)
        except ValueError as error:
            return web.json_response({"error": str(error)}, status=400, headers=HEADERS)
        except sqlite3.Error as error:
            why = {"error": f"the disk does not take it ({error}): nothing is sent before it does"}
            status = HTTPStatus.INSUFFICIENT_STORAGE
            return web.json_response(why, status=status, headers=HEADERS)
        response.headers.update(HEADERS)
        return response

    def _file(self, path: Path) -> Handler:
        async def serve(request: web.Request) -> web.StreamResponse:
            return web.FileResponse(path)

        return serve

    async def _roadmap(self, request: web.Request) -> web.StreamResponse:
        return _json(roadmap_view(self._fleet, self._walls))

    async def _picture(self, request: web.Request) -> web.StreamResponse:
        if self._walls is None:
            return web.Response(status=HTTPStatus.NOT_FOUND)
        return web.Response(body=self._walls.png, content_type="image/png")

    async def _state(self, request: web.Request) -> web.StreamResponse:
        return _json(fleet_view(self._fleet, self._clock()))

    async def _order(self, request: web.Request) -> web.StreamResponse:
        order = msgspec.json.decode(await request.read(), type=NewOrder)
        return _json(self._fleet.add_order(order.id, order.pick, order.drop, self._clock()))

    async def _cancel(self, request: web.Request) -> web.StreamResponse:
        return _json(self._fleet.cancel_order(msgspec.json.decode(await request.read(), type=Cancelled).id))

    async def _remove(self, request: web.Request) -> web.StreamResponse:
        self._fleet.remove_robot(msgspec.json.decode(await request.read(), type=Removed).name, self._clock())
        return _json({})

    async def _correct(self, request: web.Request) -> web.StreamResponse:
        correction = msgspec.json.decode(await request.read(), type=Correction)
        self._fleet.correct(correction, self._clock())
        return _json(roadmap_view(self._fleet, self._walls))

    async def _metrics(self, request: web.Request) -> web.StreamResponse:
        data = metrics(self._fleet, self._clock())
        return web.Response(body=data, headers={"Content-Type": "text/plain; version=0.0.4; charset=utf-8"})


def metrics(fleet: Fleet, now_s: float) -> bytes:
    """The figures in Prometheus' text."""
    registry = CollectorRegistry()
    orders = Gauge("chefbot_fleet_orders", "Orders by stage", ["stage"], registry=registry)
    for stage in Stage:
        orders.labels(stage).set(sum(order.stage is stage for order in fleet.orders.values()))
    age = Gauge("chefbot_fleet_robot_state_age_seconds", "Since the last state", ["robot"], registry=registry)
    vanished = Gauge("chefbot_fleet_robot_vanished", "1: vanished", ["robot"], registry=registry)
    waiting = Gauge("chefbot_fleet_robot_waits", "How many robots it waits for", ["robot"], registry=registry)
    refusals = Gauge(
        "chefbot_fleet_robot_refusals", "How often it has refused its order", ["robot"], registry=registry
    )
    waits = fleet.traffic.waits()
    for name, contact in fleet.contacts.items():
        age.labels(name).set(now_s - contact.seen_s)
        vanished.labels(name).set(fleet.has_vanished(name, now_s))
        refusals.labels(name).set(contact.refusals)
        waiting.labels(name).set(sum(wait.robot == name for wait in waits))
    Gauge("chefbot_fleet_deadlocks", "Deadlocks resolved since the start", registry=registry).set(
        fleet.traffic.deadlocks
    )
    return generate_latest(registry)


def _json(value: Any) -> web.Response:
    return web.Response(body=msgspec.json.encode(value), content_type="application/json")
