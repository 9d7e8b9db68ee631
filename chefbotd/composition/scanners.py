"""Builds lidars, and the obstacle guard over their scans: everything that needs numpy."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from chefbotd.bus import OnError
from chefbotd.composition.context import DaemonContext
from chefbotd.driving.obstacle_guard import Scans
from chefbotd.features.feature import Feature
from chefbotd.settings import Settings

if TYPE_CHECKING:
    from chefbotd.driving.scan_watch import GuardSensor
    from chefbotd.safety.outline import Outline


def lidars(context: DaemonContext) -> list[Feature]:
    """A link for each lidar."""
    if not context.settings.lidar:
        return []
    from chefbotd.driving.lidars.service import lidars

    return [lidars(context.settings.lidar, context.bus, context.clock, context.opener, context.rng)]


def robot_outline(settings: Settings) -> "Outline":
    """The radius of a disc that contains the robot's body and wheels."""
    from chefbotd.driving.scan_watch import outline_of

    return outline_of(settings.chassis, settings.body_size_m, settings.wheelbase_m)


def scan_guard(context: DaemonContext) -> Callable[[OnError], Scans] | None:
    """Builds the guard over scans; None where no scanner guards."""
    settings = context.settings
    scanners: list[GuardSensor] = [*settings.lidar, *settings.further_scanners]
    if not any(scanner.guards for scanner in scanners):
        return None
    from chefbotd.driving.scan_watch import ScanWatch

    guard, chassis, outline = settings.safety.guard, settings.chassis, robot_outline(settings)
    near = [scanner.name for scanner in settings.further_scanners if scanner.blind_near]
    return lambda on_error: ScanWatch(
        context.bus, context.clock, guard, chassis, scanners, outline, blind_near=near, on_error=on_error
    )
