"""The interface of a skill to the worker."""

from collections.abc import Generator, Iterable, Mapping
from typing import Protocol, TypeAlias, runtime_checkable

import msgspec

from chefbotd.core.events.lidars import ScanMeasured
from chefbotd.core.events.robot import OdometryUpdated, RangeMeasured
from chefbotd.core.record import Record

Struct: TypeAlias = msgspec.Struct


class JobStep(Record, frozen=True):
    """How far a job is: ``done`` of ``total``, in its own unit."""

    done: float
    total: float
    text: str


Job: TypeAlias = Generator[JobStep, None, Struct]
"""A request that takes its time, in steps well under a second, between which scans are taken and a cancel is heard.

It returns the answer. Where it is given up it is closed at a step, and must then leave the skill as it was.
"""


class Skill(Protocol):
    """One thread calls all of these, one at a time; what they return or yield is sent to the daemon.

    They may take long. What raises anything but ``Refused`` (of ``core.commands``) ends the worker, which is restarted.
    """

    def warm(self) -> None:
        """Compile, or load from the cache, what will be needed."""
        ...

    def take_scan(self, scan: ScanMeasured) -> Iterable[Struct]:
        """A lidar's turn, in the order of their stamps for each lidar."""
        ...

    def take_odometry(self, odometry: OdometryUpdated) -> Iterable[Struct]:
        """Where odometry says the robot is; usually a little later than a scan of the same time."""
        ...

    def handle(self, body: bytes) -> Struct | Job | None:
        """A request of the daemon; the answer, or a job that ends with it. None: it was done.

        Raises:
            Refused: it is not carried out.
        """
        ...

    def step(self, now_s: float) -> Iterable[Struct]:
        """Called twenty times a second, and after whatever else was done: for what has its own time."""
        ...

    def close(self) -> None:
        """The daemon ends: save what is not saved, within a second."""
        ...


@runtime_checkable
class RangeSkill(Protocol):
    """A skill that uses what ultrasonic and infrared sensors measure."""

    def take_range(self, measured: RangeMeasured) -> Iterable[Struct]:
        """An echo; a reading without one is not sent."""
        ...


@runtime_checkable
class DependentSkill(Protocol):
    """A skill that builds on others of the same worker."""

    def connect(self, others: Mapping[str, Skill]) -> None:
        """The skills by name; called once, when all are loaded."""
        ...
