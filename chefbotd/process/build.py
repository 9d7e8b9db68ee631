"""A daemon with what it needs of the process: the file of its latch and the supervisor of its services."""

import random
from collections.abc import Sequence

from chefbotd.app import Daemon, FeatureBuilder
from chefbotd.clock import Clock
from chefbotd.link.port import open_port
from chefbotd.link.reconnect import Opener
from chefbotd.process.latch_file import LatchFile, path_of
from chefbotd.process.supervisor import Supervisor
from chefbotd.settings import Settings


def build(
    settings: Settings,
    *,
    clock: Clock,
    opener: Opener = open_port,
    simulated: bool = False,
    rng: random.Random | None = None,
    features: Sequence[FeatureBuilder] = (),
) -> Daemon:
    """The robot of this configuration, ready to run; ``features`` are further ones."""
    return Daemon(
        settings,
        clock=clock,
        latch=LatchFile(path_of(settings.latch, settings.robot.name, simulated=simulated)),
        supervisor=Supervisor(clock),
        opener=opener,
        simulated=simulated,
        rng=rng,
        features=features,
    )
