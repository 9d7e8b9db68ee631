"""One depth camera as the daemon sees it: a child process that is started, heard, and started again."""

import asyncio
import random

import numpy as np
import structlog

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.depth_camera.link.process import (
    BEARINGS,
    BadMessage,
    DepthChild,
    MessageReader,
    Spawn,
)
from chefbotd.components.depth_camera.parameters import DepthSourceParameters
from chefbotd.core.events.lidars import DepthCameraChanged, ScanMeasured
from chefbotd.core.scan import Floats, LaserScan
from chefbotd.core.sentence import Sentence
from chefbotd.inputs import inputs_of

log = structlog.get_logger(component="depth camera")

START_S = 15.0
"""What a camera may take to its first image: its library looks for devices on every bus (assumed)."""

FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 30.0


class DepthCamera:
    """Publishes a scan for each image; ``scans`` and ``starts`` count."""

    def __init__(
        self, parameters: DepthSourceParameters, bus: Bus, clock: Clock, spawn: Spawn, rng: random.Random
    ) -> None:
        self.parameters = parameters
        self._bus, self._entries, self._spawn, self._rng = bus, inputs_of(clock), spawn, rng
        self._reported: tuple[bool, str] | None = None
        self.scans = self.starts = 0

    async def run(self) -> None:
        """Keep the camera's process running until cancelled."""
        wait_s = 0.0
        while True:
            scans = self.scans
            reason = await self._serve_once()
            self._report_health(healthy=False, reason=reason)
            longer_s = 0.0 if self.scans > scans else 2 * wait_s
            wait_s = min(max(longer_s, FIRST_WAIT_S), LONGEST_WAIT_S)
            await asyncio.sleep(wait_s * self._rng.uniform(0.8, 1.2))

    async def _serve_once(self) -> str:
        """Start the process and listen until it ends or falls silent; why it did."""
        self.starts += 1
        try:
            child = await self._spawn(self.parameters)
        except OSError as error:
            return f"its process cannot be started: {error.strerror or error}"
        reason = ""
        try:
            reason = await self._read_scans(child)
        finally:
            ended = await child.end()
        return reason or ended

    async def _read_scans(self, child: DepthChild) -> str:
        """Publish what comes; the reason for ending, empty if the process has ended by itself."""
        reader, bearing_rad, patience_s = MessageReader(), np.zeros(0), START_S
        while True:
            try:
                async with asyncio.timeout(patience_s):
                    data = await child.read()
            except TimeoutError:
                return Sentence(
                    "depth_camera.silent",
                    "no image for {seconds:g} s: is the camera plugged in, or does its library hang?",
                    seconds=patience_s,
                )
            if not data:
                return ""
            try:
                for message in reader.feed_bytes(data):
                    if message.kind == BEARINGS:
                        bearing_rad = message.values
                    else:
                        self._publish_scan(message.stamp_s, bearing_rad, message.values)
                        patience_s = self.parameters.silence_timeout_s
            except BadMessage as error:
                return str(error)

    def _publish_scan(self, stamp_s: float, bearing_rad: Floats, range_m: Floats) -> None:
        if len(range_m) != len(bearing_rad):
            raise BadMessage(f"{len(range_m)} ranges for {len(bearing_rad)} bearings")
        self.scans += 1
        self._report_health(healthy=True, reason="")
        scan = LaserScan(stamp_s, bearing_rad, range_m, np.zeros(len(range_m)))
        mount = self.parameters.base_from_camera
        self._entries.observe(self._bus, ScanMeasured(stamp_s, self.parameters.name, mount, scan))

    def _report_health(self, *, healthy: bool, reason: str) -> None:
        """Publish and log a change."""
        if (healthy, reason) == self._reported:
            return
        self._reported, name = (healthy, reason), self.parameters.name
        self._entries.observe(self._bus, DepthCameraChanged(self._entries.now_s(), name, healthy, reason))
        if healthy:
            log.info("depth camera sends images", camera=name)
        else:
            log.warning("depth camera sends no images", camera=name, reason=reason)
