"""What a component is built with, ours and strangers' alike."""

from collections.abc import Callable, Coroutine, Mapping
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from msgspec import Struct

from chefbotd.bus import Bus
from chefbotd.inputs import InputLog

if TYPE_CHECKING:
    from chefbotd.composition.context import DaemonParts
    from chefbotd.driving.inner_driver import InnerDriver
    from chefbotd.settings import Settings

S = TypeVar("S")
A = TypeVar("A")
Offered = TypeVar("Offered")
M = TypeVar("M", bound=Struct)


class SkillHost(Protocol):
    """The worker, a process of its own that runs skills (``components.worker.process.Worker``)."""

    @property
    def is_ready(self) -> bool:
        """Whether it takes requests."""
        ...

    def add_skill(self, name: str, reference: str, parameters: bytes) -> None:
        """Have it load a skill; raises ``ValueError`` where it has one of this name."""
        ...

    def add_listener(self, skill: str, kind: type[M], listener: Callable[[M], None]) -> None:
        """Call ``listener`` with the records of this class that this skill tells without having been asked."""
        ...

    def add_on_ready(self, handler: Callable[[], None]) -> None:
        """Call ``handler`` each time it has become ready, and knows nothing of what the one before it was sent."""
        ...

    def tell(self, skill: str, body: Struct) -> None:
        """Have a skill do something whose answer nobody needs; never waits."""
        ...

    async def request(self, skill: str, body: Struct, answer: type[A], *, deadline_s: float) -> A:
        """Have a skill do something, and return what it answers.

        Raises:
            Refused: it was not done, and why.
        """
        ...


class ConnectedHardware(Struct, frozen=True):
    """A simulated robot that is plugged in: ``settings`` name its devices.

    ``run`` simulates it until cancelled, and is handed the function that publishes what is true. ``substitutes`` are
    what components use in place of their own processes, by the component's name.
    """

    settings: "Settings"
    run: Callable[[Callable[[object], None]], Coroutine[Any, Any, None]]
    substitutes: Mapping[str, Any]


class Context(Struct, Generic[S], frozen=True):
    """What a component is built with; ``section`` is its own section of the configuration.

    ``driver`` moves the robot as the source of the component's name, None where ``[safety.sources]`` does not have it.
    ``worker`` runs the component's skills, None where there is no worker. ``clock`` is to be asked for the time and for
    timers, so that a recording can be replayed. ``parts`` are the daemon's own: they may change with every version.
    ``others`` is what components that were built before offer, by name. ``substitute`` is what the component uses in
    place of its own process or thread, as in a test; None: it starts its own.
    """

    section: S
    bus: Bus
    clock: InputLog
    robot_name: str
    settings: "Settings"
    driver: "InnerDriver | None"
    worker: SkillHost | None
    others: Mapping[str, Any]
    parts: "DaemonParts"
    substitute: Any = None

    def of(self, name: str, kind: type[Offered]) -> Offered:
        """What the component of this name offers.

        Raises:
            LookupError: it is not built, or offers something else.
        """
        offered = self.others.get(name)
        if not isinstance(offered, kind):
            raise LookupError(f"the component {name!r} offers no {kind.__name__} here")
        return offered
