"""One diagnosis of the doctor: what it may use, whom it may ask, and what it has found so far."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from chefbotd.cli.doctor.asking import Asker
from chefbotd.clock import Clock
from chefbotd.doctor.finding import Finding
from chefbotd.doctor.wheels import WheelSetting
from chefbotd.link.reconnect import Opener
from chefbotd.settings import Settings

Report = Callable[[Finding], None]


@dataclass(slots=True)
class Diagnosis:
    """``seconds`` is how long the robot is listened to; with ``motors`` the wheels may be driven, once asked.

    ``wanted_device`` is the board's device if the user named one.
    """

    settings: Settings
    asker: Asker
    report: Report
    opener: Opener
    clock: Clock
    seconds: float = 5.0
    motors: bool = False
    wanted_device: str | None = None
    findings: list[Finding] = field(default_factory=list)

    def find(self, *findings: Finding) -> None:
        """Keep and report findings, in the order of the walk."""
        for finding in findings:
            self.findings.append(finding)
            self.report(finding)

    def find_all(self, findings: Iterable[Finding]) -> None:
        """The same for any number."""
        self.find(*findings)

    @property
    def wheels(self) -> list[WheelSetting]:
        """The wheels as they are configured."""
        chassis = self.settings.chassis
        return [
            WheelSetting(
                wheel.name, wheel.side.value == "left", wheel.radius_m, wheel.motor_sign, wheel.encoder_sign
            )
            for wheel in chassis.wheels
        ]
