"""A process for each depth camera, the topic ``depth_cameras``, and the cameras' metrics."""

import random
from collections.abc import Mapping, Sequence

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.depth_camera.link.camera import DepthCamera
from chefbotd.components.depth_camera.link.process import Spawn, spawn_program
from chefbotd.components.depth_camera.models import DepthCamerasData
from chefbotd.components.depth_camera.parameters import DepthSourceParameters
from chefbotd.core.events.lidars import DepthCameraChanged
from chefbotd.features.feature import Feature, Service
from chefbotd.metrics import Metrics
from chefbotd.rpc.topics import Topic

Health = Mapping[str, DepthCameraChanged]


def depth_cameras(
    parameters: Sequence[DepthSourceParameters],
    bus: Bus,
    clock: Clock,
    rng: random.Random,
    spawn: Spawn = spawn_program,
    further_topics: Sequence[Topic] = (),
) -> Feature:
    """The feature for depth cameras, each with its own process; ``further_topics`` are added to its topics."""
    cameras = [DepthCamera(camera, bus, clock, spawn, rng) for camera in parameters]
    return Feature(
        "depth_cameras",
        services=tuple(Service(f"depth camera {camera.parameters.name}", camera.run) for camera in cameras),
        topics=(topic(), *further_topics),
        add_metrics=lambda metrics: _add_metrics(metrics, cameras),
    )


def topic() -> Topic:
    """The topic ``depth_cameras``."""
    return Topic("depth_cameras", (DepthCameraChanged,), DepthCamerasData, _data, join=_join)


def _join(health: Health | None, event: DepthCameraChanged) -> Health:
    return {**(health or {}), event.camera: event}


def _data(health: Health) -> DepthCamerasData:
    return DepthCamerasData(tuple(health.values()))


def _add_metrics(metrics: Metrics, cameras: Sequence[DepthCamera]) -> None:
    metrics.counters(
        "depth_scans",
        "Depth images that were converted to scans.",
        "camera",
        lambda: {camera.parameters.name: camera.scans for camera in cameras},
    )
    metrics.counters(
        "depth_camera_starts",
        "Starts of the depth cameras' processes.",
        "camera",
        lambda: {camera.parameters.name: camera.starts for camera in cameras},
    )
