"""Its section, its events, its service, its method and its topic."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

from pydantic import Field, SecretStr

from chefbot_pressure.skill import DistanceDriven
from chefbotd.component_context import Context
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import Twist2D
from chefbotd.core.parameters import Parameters
from chefbotd.core.record import Record
from chefbotd.features.feature import Feature, Service
from chefbotd.rpc.method import Caller, method, methods_of
from chefbotd.rpc.models import DONE, Done, NoParams
from chefbotd.rpc.parameters import Role
from chefbotd.rpc.topics import Topic, same_names
from chefbotd.settings import Settings


class PressureParameters(Parameters):
    """The sensor writes hPa into ``file``; ``password`` opens it."""

    file: Path
    rise_hpa: float = Field(0.5, gt=0, le=100)
    period_s: float = Field(0.1, ge=0.01, le=10)
    password: SecretStr | None = None


def check(section: PressureParameters, settings: Settings) -> Iterator[str]:
    """It must be read more often than clients may send requests."""
    if section.period_s > settings.api.request_timeout_s:
        yield f"period_s {section.period_s:g} is longer than api.request_timeout_s"


class PressureMeasured(Record, frozen=True):
    """Came from outside: what the sensor measured."""

    stamp_s: float
    pressure_hpa: float


class PressureRose(Record, frozen=True):
    """Follows from the measurements: how much it has risen in all, and how far the robot has driven."""

    stamp_s: float
    pressure_hpa: float
    rises: int
    driven_m: float


class PressureData(Record, frozen=True):
    """The last rise."""

    pressure_hpa: float
    rises: int
    driven_m: float


class PressureState(Record, frozen=True):
    """What a recording has to hold."""

    least_hpa: float
    rises: int
    driven_m: float


class PressureService:
    """Counts the rises of the pressure."""

    def __init__(self, context: Context[PressureParameters]) -> None:
        self._section, self._bus, self._clock = context.section, context.bus, context.clock
        self._driver = context.driver
        self._least_hpa, self._rises, self._driven_m = float("inf"), 0, 0.0
        context.bus.add_handler(self._take, PressureMeasured)
        if context.worker is not None:
            context.worker.add_listener("distance", DistanceDriven, self._take_distance)

    def state(self) -> PressureState:
        """What it remembers."""
        return PressureState(self._least_hpa, self._rises, self._driven_m)

    def restore(self, state: PressureState) -> None:
        """Go on from there."""
        self._least_hpa, self._rises, self._driven_m = state.least_hpa, state.rises, state.driven_m

    async def run(self) -> None:
        """Read the sensor, until cancelled: what it says comes from outside."""
        while True:
            pressure_hpa = float(self._section.file.read_text(encoding="ascii"))
            self._clock.observe(self._bus, PressureMeasured(self._clock.now_s(), pressure_hpa))
            await asyncio.sleep(self._section.period_s)

    def _take_distance(self, event: DistanceDriven) -> None:
        self._driven_m = event.distance_m

    def _take(self, event: PressureMeasured) -> None:
        if event.pressure_hpa < self._least_hpa:
            self._least_hpa = event.pressure_hpa
        elif event.pressure_hpa >= self._least_hpa + self._section.rise_hpa:
            self._least_hpa, self._rises = event.pressure_hpa, self._rises + 1
            self._bus.publish(PressureRose(event.stamp_s, event.pressure_hpa, self._rises, self._driven_m))

    @method(role=Role.DRIVE, moves=True)
    def creep(self, caller: Caller, params: NoParams) -> Done:
        """Drive on slowly, for as long as one command lasts."""
        if self._driver is None:
            raise Refused(RefusalKind.UNKNOWN_SOURCE, "[safety.sources] has no pressure")
        self._driver.begin(self._driver.stop_number, "this was asked for")
        self._driver.drive(Twist2D(0.1, 0.0), self._clock.now_s())
        return DONE

    @method(role=Role.DRIVE, moves=False)
    def reset_pressure(self, caller: Caller, params: NoParams) -> PressureData:
        """Count from zero again; answers what was counted."""
        before = PressureData(self._least_hpa, self._rises, self._driven_m)
        self._rises = 0
        return before


def build(context: Context[PressureParameters]) -> Feature:
    """The feature."""
    service = PressureService(context)
    return Feature(
        "pressure",
        services=(Service("pressure", service.run),),
        methods=methods_of(service),
        topics=(Topic("pressure", (PressureRose,), PressureData, same_names(PressureData)),),
        parts={"pressure": service},
    )
