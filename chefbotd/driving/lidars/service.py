"""A link for each lidar, the topics ``scan`` and ``lidars``, and the links' metrics."""

import random
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.core.events.lidars import LidarChanged, ScanMeasured
from chefbotd.driving.lidars.models import LidarData, LidarsData, ScanData
from chefbotd.features.feature import Feature, Service
from chefbotd.link.lidar.session import LidarSession, link_of, port_of
from chefbotd.link.reconnect import Opener, PortLink
from chefbotd.metrics import Metrics
from chefbotd.rpc.topics import Topic
from chefbotd.sensing.lidar import LidarParameters

EVEN_RAD = 0.002
"""Bearings that differ from even spacing by at most this (a tenth of a degree) are sent as start and step."""

Health = Mapping[str, LidarChanged]


def lidars(
    parameters: Sequence[LidarParameters], bus: Bus, clock: Clock, opener: Opener, rng: random.Random
) -> Feature:
    """Every lidar, each on a link of its own."""
    sessions = [LidarSession(bus, clock, lidar) for lidar in parameters]
    links = [
        PortLink(port_of(session.lidar), session, opener, clock, rng, name=link_of(session.lidar))
        for session in sessions
    ]
    return Feature(
        "lidars",
        services=tuple(
            Service(f"lidar {session.lidar.name}", link.run)
            for session, link in zip(sessions, links, strict=True)
        ),
        topics=topics(parameters),
        add_metrics=lambda metrics: _add_metrics(metrics, sessions),
    )


def topics(parameters: Sequence[LidarParameters]) -> tuple[Topic, ...]:
    """The topics of these lidars."""
    models = {lidar.name: str(lidar.model) for lidar in parameters}

    def data(health: Health) -> LidarsData:
        return LidarsData(
            lidars=tuple(_lidar_data(models, health[name]) for name in models if name in health)
        )

    return (
        Topic("scan", (ScanMeasured,), ScanData, scan_data, on_demand=True, for_guests=True),
        Topic("lidars", (LidarChanged,), LidarsData, data, join=_join),
    )


def _join(health: Health | None, event: LidarChanged) -> Health:
    return {**(health or {}), event.lidar: event}


def _lidar_data(models: Mapping[str, str], event: LidarChanged) -> LidarData:
    return LidarData(
        lidar=event.lidar,
        model=models[event.lidar],
        device=event.device,
        state="up" if event.is_open else "down",
        healthy=event.healthy,
        condition=event.condition,
        reason=event.reason,
        stamp_s=event.stamp_s,
    )


def scan_data(event: ScanMeasured) -> ScanData:
    """A scan in whole millimetres, with bearings as start and step if they are even."""
    scan, mount = event.scan, event.base_from_lidar
    bearing_rad, count = scan.bearing_rad, len(scan.bearing_rad)
    start_rad = float(bearing_rad[0]) if count else 0.0
    step_rad = float(bearing_rad[-1] - bearing_rad[0]) / (count - 1) if count > 1 else 0.0
    even = (
        count == 0 or float(np.abs(bearing_rad - start_rad - step_rad * np.arange(count)).max()) <= EVEN_RAD
    )
    range_m = np.where(np.isfinite(scan.range_m), scan.range_m, 0.0)
    return ScanData(
        lidar=event.lidar,
        x_m=mount.x_m,
        y_m=mount.y_m,
        yaw_rad=mount.heading_rad,
        bearing_start_rad=round(start_rad, 6),
        bearing_step_rad=round(step_rad, 9) if even else None,
        bearing_mrad=None if even else tuple(np.rint(bearing_rad * 1000).astype(int).tolist()),
        range_mm=tuple(np.rint(range_m * 1000).astype(int).tolist()),
        duration_s=round(float(scan.after_s[-1] - scan.after_s[0]), 6) if count else 0.0,
    )


def _add_metrics(metrics: Metrics, sessions: Sequence[LidarSession]) -> None:
    def by_lidar(read: Callable[[LidarSession], int]) -> Callable[[], Mapping[str, int]]:
        return lambda: {session.lidar.name: read(session) for session in sessions}

    def refused() -> Mapping[str, int]:
        return {
            f"{session.lidar.name} {reason}": count
            for session in sessions
            for reason, count in session.refused.items()
        }

    metrics.counters(
        "lidar_scans", "Whole turns of the lidars.", "lidar", by_lidar(lambda of_lidar: of_lidar.memory.scans)
    )
    metrics.counters(
        "lidar_packets",
        "Valid packets or points from the lidars.",
        "lidar",
        by_lidar(lambda of_lidar: of_lidar.reader.packets),
    )
    metrics.counters(
        "lidar_bytes_in",
        "Bytes from the lidars.",
        "lidar",
        by_lidar(lambda of_lidar: of_lidar.memory.bytes_in),
    )
    metrics.counters("lidar_refused", "Bytes, packets and turns that were rejected.", "reason", refused)
    metrics.counters(
        "lidar_opens",
        "Connections of the lidars' ports.",
        "lidar",
        by_lidar(lambda of_lidar: of_lidar.memory.opens),
    )
