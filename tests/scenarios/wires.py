"""What may be wrong between the simulated robot and its daemon: broken encoders, false readings, a bad cable."""

from collections.abc import Callable

from chefbotd.sim.faults import BadCable, CableParameters
from chefbotd.testing.daemon import SimulatedRobot

Rewrite = Callable[[list[bytes]], list[bytes] | None]


def rewire(robot: SimulatedRobot, kind: bytes, rewrite: Rewrite) -> None:
    """From now on the fields of these lines pass through ``rewrite``; None is a line that never comes."""
    feed = robot.device.transport.feed

    def line(text: bytes) -> bytes:
        fields = text.split(b"\t")
        if fields[0] != kind:
            return text + b"\n"
        changed = rewrite(fields[1:])
        return b"" if changed is None else b"\t".join([kind, *changed]) + b"\n"

    robot.device.transport.feed = lambda data: feed(b"".join(line(t) for t in data.splitlines()))


def frozen(index: int) -> Rewrite:
    """An encoder that was unplugged: its counts stand still."""
    kept: list[bytes] = []

    def rewrite(counts: list[bytes]) -> list[bytes]:
        kept[:] = kept or [counts[index]]
        return [*counts[:index], kept[0], *counts[index + 1 :]]

    return rewrite


def reversed_from_now(index: int) -> Rewrite:
    """An encoder whose two channels were exchanged: it counts backwards from where it is."""
    start: list[int] = []

    def rewrite(counts: list[bytes]) -> list[bytes]:
        start[:] = start or [int(counts[index])]
        backwards = b"%d" % (2 * start[0] - int(counts[index]))
        return [*counts[:index], backwards, *counts[index + 1 :]]

    return rewrite


def jumping(index: int) -> Rewrite:
    """An encoder whose every reading is somewhere else."""
    seen: list[bytes] = []

    def rewrite(counts: list[bytes]) -> list[bytes]:
        seen.append(counts[index])
        elsewhere = b"%d" % (int(counts[index]) + 100_000 * (-1) ** len(seen) * len(seen))
        return [*counts[:index], elsewhere, *counts[index + 1 :]]

    return rewrite


def damage(robot: SimulatedRobot, shares: dict[str, float], seed: int) -> None:
    """Put a bad cable into both directions."""
    transport, parameters = robot.device.transport, CableParameters(**shares)
    heard, said = BadCable(parameters, seed), BadCable(parameters, seed + 1)
    feed, write = transport.feed, robot.device.on_write
    transport.feed = lambda data: feed(heard.carry(data))
    robot.device.on_write = lambda data: write(said.carry(data))
