"""Builds a daemon with the latch file and the supervisor of its process."""

import random
from collections.abc import Sequence
from typing import TYPE_CHECKING

from chefbotd.app import Daemon
from chefbotd.clock import Clock
from chefbotd.composition.context import DepthSpawn, FeatureBuilder, StartWriter
from chefbotd.link.port import open_port
from chefbotd.link.reconnect import Opener
from chefbotd.process.latch_file import LatchFile, path_of
from chefbotd.process.supervisor import Supervisor
from chefbotd.settings import Settings

if TYPE_CHECKING:
    from chefbotd.worker.spawn import Spawn


def build(
    settings: Settings,
    *,
    clock: Clock,
    opener: Opener = open_port,
    simulated: bool = False,
    rng: random.Random | None = None,
    features: Sequence[FeatureBuilder] = (),
    spawn_worker: "Spawn | None" = None,
    depth_spawn: DepthSpawn | None = None,
    start_writer: StartWriter | None = None,
) -> Daemon:
    """The robot of this configuration, ready to run; the rest is as in ``Daemon``."""
    return Daemon(
        settings,
        clock=clock,
        latch=LatchFile(path_of(settings.latch, settings.robot.name, simulated=simulated)),
        supervisor=Supervisor(clock),
        opener=opener,
        simulated=simulated,
        rng=rng,
        features=features,
        spawn_worker=spawn_worker,
        depth_spawn=depth_spawn,
        start_writer=start_writer,
    )
